/* What a generated program is given by `runtime.c`, which calls it. */

#include <stdatomic.h>
#include <stdint.h>

/* Where the workers of a large program wait for each other. */
typedef struct {
    _Alignas(64) atomic_int arrived;
    _Alignas(64) atomic_int round;
} ck_barrier;

/* A program's memory for B copies. Numbers are double or float, as the program was compiled. The members of the batch
   are filled up to a stride with copies of the last one. */
typedef struct {
    void *table;               /* (n_rows, stride) */
    int64_t stride;
    int64_t batch;             /* B */
    const void *shared;        /* constants for all members, one after the other */
    const void *own;           /* constants of every member, (n, stride) */
    const void *const *arrays; /* long constants and indices of a program of loops */
    void *const *rings;        /* every memory, (depth, n_slots, stride) */
    const uint64_t *seeds;     /* (stride,) */
    int64_t time;              /* control steps before the state was loaded */
    int64_t done;              /* control steps since then, from which follows where the rings stand */
    ck_barrier *barrier;
    atomic_int suspect;        /* somewhere something is not finite */
} ck_context;

/* Some control steps. */
typedef struct {
    int64_t steps;         /* T */
    const double *inputs;  /* (T, B, n_inputs); NULL: those that stand in the table */
    const int32_t *rows;   /* rows to record, (n_rows,) */
    int64_t n_rows;
    double *record;        /* (T, B, n_rows) */
} ck_job;

/* Does a worker's part of a job; returns the first step after which something was not finite, or T. */
typedef int64_t ck_program(ck_context *, const ck_job *, int64_t worker, int64_t workers);
