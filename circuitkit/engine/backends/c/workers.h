/* Workers: threads that live as long as the process, and sleep when there has been nothing to do for a while.

   A job waits only a moment for workers, and is then shared among those that came: a thread to which the system gives
   no time must not hold it up. The gate has in its upper bits the number of the job, in the lowest eight how many have
   come, and a bit that says that the gate is closed. */

#include <pthread.h>
#include <sched.h>
#include <time.h>

#include "context.h"

#if defined(__x86_64__) || defined(__i386__)
#define PAUSE() __builtin_ia32_pause()
#else
#define PAUSE() (void)0
#endif
#define MAX_WORKERS 64
#define WORTH_WAKING 1000000     /* work (terms and expressions) that takes several times as long as waking a thread */
#define SOON_NS 100000           /* jobs that follow each other so fast are worth it together */
#define SPINS_BEFORE_SLEEP 20000 /* some 100 us */
#define SPINS_BEFORE_YIELD 2000
#define WORK_OF_A_SPIN 3000 /* so that waiting for workers takes a small part of the time of the work */
#define FEWEST_SPINS 50
#define MOST_SPINS 5000

#define GATE_COUNT 0xFF
#define GATE_CLOSED 0x100
#define GATE_JOB(gate) ((gate) >> 9)

static struct {
    pthread_mutex_t in_use; /* by one job at a time */
    pthread_mutex_t mutex;
    pthread_cond_t wake;
    int n_threads;
    ck_program *program;
    ck_context *context;
    const ck_job *job;
    int64_t wanted; /* workers beside the one whose job it is */
    int64_t results[MAX_WORKERS];
    int64_t last_ns; /* when the last job came */
    ck_barrier barrier;
    _Alignas(64) atomic_uint_fast64_t gate;
    _Alignas(64) atomic_int finished;
    _Alignas(64) atomic_int sleeping;
} pool = {
    .in_use = PTHREAD_MUTEX_INITIALIZER,
    .mutex = PTHREAD_MUTEX_INITIALIZER,
    .wake = PTHREAD_COND_INITIALIZER,
    .gate = GATE_CLOSED,
};

/* Until there is another job than the one that was seen last. */
static uint64_t await_job(uint64_t seen)
{
    uint64_t gate;
    for (int spins = 0; spins < SPINS_BEFORE_SLEEP; spins++) {
        gate = atomic_load_explicit(&pool.gate, memory_order_acquire);
        if (GATE_JOB(gate) != seen) return gate;
        PAUSE();
    }
    pthread_mutex_lock(&pool.mutex);
    atomic_fetch_add(&pool.sleeping, 1);
    while (gate = atomic_load(&pool.gate), GATE_JOB(gate) == seen) pthread_cond_wait(&pool.wake, &pool.mutex);
    atomic_fetch_sub(&pool.sleeping, 1);
    pthread_mutex_unlock(&pool.mutex);
    return gate;
}

/* Whether this worker is in time for a job; its number is then the number of those who have come. */
static int64_t join(uint64_t gate)
{
    const uint64_t job = GATE_JOB(gate);
    while (GATE_JOB(gate) == job && !(gate & GATE_CLOSED) && (int64_t)(gate & GATE_COUNT) < pool.wanted)
        if (atomic_compare_exchange_weak(&pool.gate, &gate, gate + 1)) return (int64_t)(gate & GATE_COUNT) + 1;
    return 0;
}

static void *work(void *argument)
{
    uint64_t seen = (uint64_t)(uintptr_t)argument;
    for (;;) {
        uint64_t gate = await_job(seen);
        const int64_t worker = join(gate);
        seen = GATE_JOB(gate);
        if (!worker) continue;
        for (int spins = 0; !((gate = atomic_load(&pool.gate)) & GATE_CLOSED); spins++) {
            PAUSE();
            if (spins > SPINS_BEFORE_YIELD) sched_yield();
        }
        const int64_t workers = 1 + (int64_t)(gate & GATE_COUNT);
        pool.results[worker] = pool.program(pool.context, pool.job, worker, workers);
        atomic_fetch_add_explicit(&pool.finished, 1, memory_order_release);
    }
    return NULL;
}

/* Makes threads until there are n; says how many there are. */
static int have_threads(int n)
{
    pthread_attr_t attributes;
    if (pool.n_threads >= n || pthread_attr_init(&attributes)) return pool.n_threads;
    pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    while (pool.n_threads < n) {
        pthread_t thread;
        void *seen = (void *)(uintptr_t)GATE_JOB(atomic_load(&pool.gate));
        if (pthread_create(&thread, &attributes, work, seen)) break;
        pool.n_threads++;
    }
    pthread_attr_destroy(&attributes);
    return pool.n_threads;
}

static int64_t nanoseconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * INT64_C(1000000000) + now.tv_nsec;
}

/* Calls workers, and closes the gate behind those that come soon; says how many. */
static int64_t call_workers(int64_t wanted, int64_t spins)
{
    const uint64_t gate = (GATE_JOB(atomic_load(&pool.gate)) + 1) << 9;
    pool.wanted = wanted;
    atomic_store_explicit(&pool.barrier.arrived, 0, memory_order_relaxed);
    atomic_store_explicit(&pool.finished, 0, memory_order_relaxed);
    atomic_store(&pool.gate, gate);
    if (atomic_load(&pool.sleeping)) {
        pthread_mutex_lock(&pool.mutex);
        pthread_cond_broadcast(&pool.wake);
        pthread_mutex_unlock(&pool.mutex);
    }
    for (int64_t i = 0; i < spins && (int64_t)(atomic_load(&pool.gate) & GATE_COUNT) < wanted; i++) PAUSE();
    return (int64_t)(atomic_fetch_or(&pool.gate, GATE_CLOSED) & GATE_COUNT);
}

/* Does a job with several workers; with this thread alone while another job is being done, or while the others sleep
   and waking them would take longer: in a control loop, they sleep between any two steps. */
static int64_t share_out(ck_program *program, ck_context *context, const ck_job *job, int64_t workers, int64_t work)
{
    if (workers <= 1 || pthread_mutex_trylock(&pool.in_use)) return program(context, job, 0, 1);
    const int64_t last = pool.last_ns;
    int64_t others = 0;
    pool.last_ns = nanoseconds();
    if (work * job->steps >= WORTH_WAKING || pool.last_ns - last < SOON_NS) {
        const int64_t threads = have_threads((int)workers - 1);
        context->barrier = &pool.barrier;
        pool.program = program, pool.context = context, pool.job = job;
        const int64_t spins = work * job->steps / WORK_OF_A_SPIN;
        others = call_workers(threads < workers - 1 ? threads : workers - 1,
                              spins < FEWEST_SPINS ? FEWEST_SPINS : spins > MOST_SPINS ? MOST_SPINS : spins);
    }
    int64_t result = program(context, job, 0, 1 + others);
    for (int spins = 0; atomic_load_explicit(&pool.finished, memory_order_acquire) < others; spins++) {
        PAUSE();
        if (spins > SPINS_BEFORE_YIELD) sched_yield();
    }
    for (int64_t worker = 1; worker <= others; worker++)
        if (pool.results[worker] < result) result = pool.results[worker];
    if (others) pool.last_ns = nanoseconds();
    pthread_mutex_unlock(&pool.in_use);
    return result;
}

/* Threads do not follow into a forked process. */
static void forget_threads(void)
{
    pthread_mutex_init(&pool.in_use, NULL);
    pthread_mutex_init(&pool.mutex, NULL);
    pthread_cond_init(&pool.wake, NULL);
    pool.n_threads = 0;
    atomic_store(&pool.sleeping, 0);
    atomic_fetch_or(&pool.gate, GATE_CLOSED);
}
