/* The bridge between Python and generated programs: kernels that own a context, and the threads that share their work.

   Compiled once for a Python and a compiler. A kernel is made of addresses of numpy arrays, which `kernel.py` keeps. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <pthread.h>
#include <sched.h>

#include "context.h"

#if defined(__x86_64__) || defined(__i386__)
#define PAUSE() __builtin_ia32_pause()
#else
#define PAUSE() (void)0
#endif
#define MAX_WORKERS 64
#define SPINS_BEFORE_SLEEP 20000 /* some 100 us */
#define SPINS_BEFORE_YIELD 20000

/* ---- Workers: threads that live as long as the process, and sleep when there has been nothing to do for a while. */

static struct {
    pthread_mutex_t in_use; /* by one job at a time */
    pthread_mutex_t mutex;
    pthread_cond_t wake;
    int n_threads;
    ck_program *program;
    ck_context *context;
    const ck_job *job;
    int64_t workers;
    int64_t results[MAX_WORKERS];
    ck_barrier barrier;
    _Alignas(64) atomic_uint round;
    _Alignas(64) atomic_int unfinished;
    _Alignas(64) atomic_int sleeping;
} pool = {.in_use = PTHREAD_MUTEX_INITIALIZER, .mutex = PTHREAD_MUTEX_INITIALIZER, .wake = PTHREAD_COND_INITIALIZER};

static void await_round(unsigned seen)
{
    for (int spins = 0; spins < SPINS_BEFORE_SLEEP; spins++) {
        if (atomic_load_explicit(&pool.round, memory_order_acquire) != seen) return;
        PAUSE();
    }
    pthread_mutex_lock(&pool.mutex);
    atomic_fetch_add(&pool.sleeping, 1);
    while (atomic_load(&pool.round) == seen) pthread_cond_wait(&pool.wake, &pool.mutex);
    atomic_fetch_sub(&pool.sleeping, 1);
    pthread_mutex_unlock(&pool.mutex);
}

typedef struct {
    int64_t worker;
    unsigned seen;
} worker_start;

static void *work(void *argument)
{
    worker_start start = *(worker_start *)argument;
    free(argument);
    for (;;) {
        await_round(start.seen);
        start.seen++;
        if (start.worker < pool.workers)
            pool.results[start.worker] = pool.program(pool.context, pool.job, start.worker, pool.workers);
        atomic_fetch_sub_explicit(&pool.unfinished, 1, memory_order_release);
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
        worker_start *start = malloc(sizeof *start);
        if (!start) break;
        *start = (worker_start){pool.n_threads + 1, atomic_load(&pool.round)};
        if (pthread_create(&thread, &attributes, work, start)) {
            free(start);
            break;
        }
        pool.n_threads++;
    }
    pthread_attr_destroy(&attributes);
    return pool.n_threads;
}

/* Does a job with several workers, or with this thread alone while another job is being done. */
static int64_t share_out(ck_program *program, ck_context *context, const ck_job *job, int64_t workers)
{
    if (workers <= 1 || pthread_mutex_trylock(&pool.in_use)) return program(context, job, 0, 1);
    int64_t threads = have_threads((int)workers - 1);
    if (threads < workers - 1) workers = threads + 1;
    atomic_store_explicit(&pool.barrier.arrived, 0, memory_order_relaxed);
    context->barrier = &pool.barrier;
    pool.program = program, pool.context = context, pool.job = job, pool.workers = workers;
    atomic_store_explicit(&pool.unfinished, pool.n_threads, memory_order_relaxed);
    atomic_fetch_add(&pool.round, 1);
    if (atomic_load(&pool.sleeping)) {
        pthread_mutex_lock(&pool.mutex);
        pthread_cond_broadcast(&pool.wake);
        pthread_mutex_unlock(&pool.mutex);
    }
    int64_t result = program(context, job, 0, workers);
    for (int spins = 0; atomic_load_explicit(&pool.unfinished, memory_order_acquire); spins++) {
        PAUSE();
        if (spins > SPINS_BEFORE_YIELD) sched_yield();
    }
    for (int64_t worker = 1; worker < workers; worker++)
        if (pool.results[worker] < result) result = pool.results[worker];
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
}

/* ---- Kernel */

typedef struct {
    PyObject_HEAD
    ck_program *program;
    ck_context context;
    int64_t workers;
    int releases; /* whether a single step is long enough to let other Python threads run meanwhile */
    PyObject *keep;
} Kernel;

static int64_t do_job(Kernel *self, const ck_job *job)
{
    ck_context *context = &self->context;
    atomic_store_explicit(&context->suspect, 0, memory_order_relaxed);
    int64_t good = share_out(self->program, context, job, self->workers);
    context->done += good < job->steps ? good + 1 : good;
    return good;
}

static PyObject *kernel_advance(Kernel *self, PyObject *Py_UNUSED(nothing))
{
    static const ck_job one = {.steps = 1};
    int64_t good;
    if (self->releases) {
        Py_BEGIN_ALLOW_THREADS
        good = do_job(self, &one);
        Py_END_ALLOW_THREADS
    } else {
        good = do_job(self, &one);
    }
    return PyBool_FromLong(good == 1);
}

static PyObject *kernel_run(Kernel *self, PyObject *arguments)
{
    unsigned long long inputs, rows, record;
    long long steps, n_rows;
    if (!PyArg_ParseTuple(arguments, "LKKLK:run", &steps, &inputs, &rows, &n_rows, &record)) return NULL;
    ck_job job = {steps, (const double *)(uintptr_t)inputs, (const int32_t *)(uintptr_t)rows, n_rows,
                  (double *)(uintptr_t)record};
    int64_t good;
    Py_BEGIN_ALLOW_THREADS
    good = do_job(self, &job);
    Py_END_ALLOW_THREADS
    return PyLong_FromLongLong(good);
}

static PyObject *kernel_begin(Kernel *self, PyObject *arguments)
{
    long long time, done;
    if (!PyArg_ParseTuple(arguments, "LL:begin", &time, &done)) return NULL;
    self->context.time = time;
    self->context.done = done;
    Py_RETURN_NONE;
}

static PyObject *kernel_done(Kernel *self, PyObject *Py_UNUSED(nothing))
{
    return PyLong_FromLongLong(self->context.done);
}

static PyObject *kernel_new(PyTypeObject *type, PyObject *arguments, PyObject *Py_UNUSED(keywords))
{
    unsigned long long program, table, shared, own, arrays, rings, seeds;
    long long stride, batch, workers;
    int releases;
    PyObject *keep;
    if (!PyArg_ParseTuple(arguments, "KKLLKKKKKLpO:Kernel", &program, &table, &stride, &batch, &shared, &own, &arrays,
                          &rings, &seeds, &workers, &releases, &keep))
        return NULL;
    Kernel *self = (Kernel *)type->tp_alloc(type, 0);
    if (!self) return NULL;
    ck_context *context = &self->context;
    self->program = (ck_program *)(uintptr_t)program;
    context->table = (void *)(uintptr_t)table;
    context->stride = stride;
    context->batch = batch;
    context->shared = (const void *)(uintptr_t)shared;
    context->own = (const void *)(uintptr_t)own;
    context->arrays = (const void *const *)(uintptr_t)arrays;
    context->rings = (void *const *)(uintptr_t)rings;
    context->seeds = (const uint64_t *)(uintptr_t)seeds;
    self->workers = workers > MAX_WORKERS ? MAX_WORKERS : workers;
    self->releases = releases;
    self->keep = Py_NewRef(keep);
    return (PyObject *)self;
}

static int kernel_traverse(Kernel *self, visitproc visit, void *arg)
{
    Py_VISIT(Py_TYPE(self));
    Py_VISIT(self->keep);
    return 0;
}

static int kernel_clear(Kernel *self)
{
    Py_CLEAR(self->keep);
    return 0;
}

static void kernel_dealloc(Kernel *self)
{
    PyTypeObject *type = Py_TYPE(self);
    PyObject_GC_UnTrack(self);
    kernel_clear(self);
    type->tp_free(self);
    Py_DECREF(type);
}

static PyMethodDef kernel_methods[] = {
    {"advance", (PyCFunction)kernel_advance, METH_NOARGS, "One control step; whether all is finite."},
    {"run", (PyCFunction)kernel_run, METH_VARARGS, "Many; the first bad one, or their number."},
    {"begin", (PyCFunction)kernel_begin, METH_VARARGS, "The time when the state was loaded, and the steps done since."},
    {"done", (PyCFunction)kernel_done, METH_NOARGS, "Steps done since then."},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot kernel_slots[] = {
    {Py_tp_new, kernel_new},
    {Py_tp_dealloc, kernel_dealloc},
    {Py_tp_traverse, kernel_traverse},
    {Py_tp_clear, kernel_clear},
    {Py_tp_methods, kernel_methods},
    {0, NULL},
};

static PyType_Spec kernel_spec = {
    .name = "circuitkit_runtime.Kernel",
    .basicsize = sizeof(Kernel),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_IMMUTABLETYPE,
    .slots = kernel_slots,
};

static int begin_module(PyObject *module)
{
    static int is_registered = 0;
    PyObject *type = PyType_FromModuleAndSpec(module, &kernel_spec, NULL);
    if (!type) return -1;
    if (!is_registered) pthread_atfork(NULL, NULL, forget_threads);
    is_registered = 1;
    int result = PyModule_AddObjectRef(module, "Kernel", type);
    Py_DECREF(type);
    return result;
}

static PyModuleDef_Slot module_slots[] = {{Py_mod_exec, begin_module}, {0, NULL}};
static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, .m_name = "circuitkit_runtime", .m_slots = module_slots, .m_size = 0};

PyMODINIT_FUNC PyInit_circuitkit_runtime(void)
{
    return PyModuleDef_Init(&module);
}
