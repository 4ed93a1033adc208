/* The bridge between Python and generated programs: kernels that own a context, and steps as functions.

   Compiled once for a Python and a compiler. A kernel is made of addresses of numpy arrays, which
   `compiled_backend.py` keeps. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <structmember.h>

#include "workers.h"

/* ---- Kernel */

typedef struct {
    PyObject_HEAD
    ck_program *program;
    ck_context context;
    int64_t workers;
    int64_t work; /* of a step */
    int releases; /* whether a single step is long enough to let other Python threads run meanwhile */
    PyObject *keep;
} Kernel;

static int64_t do_job(Kernel *self, const ck_job *job)
{
    ck_context *context = &self->context;
    atomic_store_explicit(&context->suspect, 0, memory_order_relaxed);
    int64_t good = share_out(self->program, context, job, self->workers, self->work);
    context->done += good < job->steps ? good + 1 : good;
    return good;
}

static int is_good_step(Kernel *self)
{
    static const ck_job one = {.steps = 1};
    int64_t good;
    if (!self->releases) return do_job(self, &one) == 1;
    Py_BEGIN_ALLOW_THREADS
    good = do_job(self, &one);
    Py_END_ALLOW_THREADS
    return good == 1;
}

static PyObject *kernel_advance(Kernel *self, PyObject *Py_UNUSED(nothing))
{
    return PyBool_FromLong(is_good_step(self));
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
    long long stride, batch, workers, work;
    int releases;
    PyObject *keep;
    if (!PyArg_ParseTuple(arguments, "KKLLKKKKKLLpO:Kernel", &program, &table, &stride, &batch, &shared, &own, &arrays,
                          &rings, &seeds, &workers, &work, &releases, &keep))
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
    self->work = work;
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

/* ---- Step: a function that takes inputs, does a step, and returns the outputs of the circuit. */

/* What an array of numpy has in memory, in all versions from 1.7 on; `bind_step` looks whether it is so. */
typedef struct {
    PyObject_HEAD
    char *data;
    int n_axes;
    Py_ssize_t *shape;
    Py_ssize_t *strides;
    PyObject *base;
    PyObject *type;
    int flags;
} array;

#define ALIGNED 0x0100

typedef struct {
    PyObject_HEAD
    vectorcallfunc call;
    Kernel *kernel;
    PyObject *readout;
    PyObject *take;        /* takes what is not an array as usual */
    PyObject *fail;        /* raises an error after a bad step */
    PyTypeObject *class;   /* numpy.ndarray, */
    PyObject *double_type; /* its type of numbers, */
    Py_ssize_t n_inputs;   /* and its shape is (B, n_inputs) */
    int is_double;         /* whether the table's numbers are of that type */
} Step;

static int is_usual(const Step *self, PyObject *object)
{
    const array *given = (const array *)object;
    return Py_TYPE(object) == self->class && given->type == self->double_type && given->n_axes == 2 &&
           given->shape[0] == self->kernel->context.batch && given->shape[1] == self->n_inputs &&
           given->flags & ALIGNED;
}

#define COPY(number) \
    for (Py_ssize_t i = 0; i < self->n_inputs; i++) { \
        number *to = (number *)context->table + (1 + i) * context->stride, *const end = to + context->batch; \
        const char *from = given->data + i * given->strides[1]; \
        for (const Py_ssize_t apart = given->strides[0]; to < end; from += apart) *to++ = (number)*(const double *)from; \
    }

static void copy_inputs(const Step *self, const array *given)
{
    const ck_context *context = &self->kernel->context;
    if (self->is_double) COPY(double)
    else COPY(float)
}

static PyObject *step_call(Step *self, PyObject *const *arguments, size_t n_flagged, PyObject *names)
{
    const Py_ssize_t n = PyVectorcall_NARGS(n_flagged) + (names ? PyTuple_GET_SIZE(names) : 0);
    if (n > 1 || (names && PyTuple_GET_SIZE(names) && PyUnicode_CompareWithASCIIString(PyTuple_GET_ITEM(names, 0), "inputs"))) {
        PyErr_SetString(PyExc_TypeError, "step() takes at most one argument, 'inputs'");
        return NULL;
    }
    if (n && arguments[0] != Py_None) {
        if (is_usual(self, arguments[0])) {
            copy_inputs(self, (const array *)arguments[0]);
        } else {
            PyObject *done = PyObject_CallOneArg(self->take, arguments[0]);
            if (!done) return NULL;
            Py_DECREF(done);
        }
    }
    if (is_good_step(self->kernel)) return Py_NewRef(self->readout);
    PyObject *nothing = PyObject_CallNoArgs(self->fail);
    if (nothing) {
        Py_DECREF(nothing);
        PyErr_SetString(PyExc_FloatingPointError, "something is not finite");
    }
    return NULL;
}

static int step_traverse(Step *self, visitproc visit, void *arg)
{
    Py_VISIT(Py_TYPE(self));
    Py_VISIT((PyObject *)self->kernel);
    Py_VISIT(self->readout);
    Py_VISIT(self->take);
    Py_VISIT(self->fail);
    Py_VISIT((PyObject *)self->class);
    Py_VISIT(self->double_type);
    return 0;
}

static int step_clear(Step *self)
{
    Py_CLEAR(self->kernel);
    Py_CLEAR(self->readout);
    Py_CLEAR(self->take);
    Py_CLEAR(self->fail);
    Py_CLEAR(self->class);
    Py_CLEAR(self->double_type);
    return 0;
}

static void step_dealloc(Step *self)
{
    PyTypeObject *type = Py_TYPE(self);
    PyObject_GC_UnTrack(self);
    step_clear(self);
    type->tp_free(self);
    Py_DECREF(type);
}

static PyObject *step_new(PyTypeObject *type, PyObject *arguments, PyObject *Py_UNUSED(keywords))
{
    PyObject *kernel, *readout, *take, *fail, *example;
    int is_double;
    if (!PyArg_ParseTuple(arguments, "OOOOOp:Step", &kernel, &readout, &take, &fail, &example, &is_double)) return NULL;
    Step *self = (Step *)type->tp_alloc(type, 0);
    if (!self) return NULL;
    const array *given = (const array *)example;
    self->call = (vectorcallfunc)step_call;
    self->kernel = (Kernel *)Py_NewRef(kernel);
    self->readout = Py_NewRef(readout);
    self->take = Py_NewRef(take);
    self->fail = Py_NewRef(fail);
    self->class = (PyTypeObject *)Py_NewRef((PyObject *)Py_TYPE(example));
    self->double_type = Py_NewRef(given->type);
    self->n_inputs = given->shape[1];
    self->is_double = is_double;
    return (PyObject *)self;
}

static PyMemberDef step_members[] = {
    {"__vectorcalloffset__", T_PYSSIZET, offsetof(Step, call), READONLY, NULL},
    {NULL, 0, 0, 0, NULL},
};

static PyType_Slot step_slots[] = {
    {Py_tp_new, step_new},
    {Py_tp_dealloc, step_dealloc},
    {Py_tp_traverse, step_traverse},
    {Py_tp_clear, step_clear},
    {Py_tp_call, PyVectorcall_Call},
    {Py_tp_members, step_members},
    {0, NULL},
};

static PyType_Spec step_spec = {
    .name = "circuitkit_runtime.Step",
    .basicsize = sizeof(Step),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_HAVE_VECTORCALL,
    .slots = step_slots,
};

/* Whether arrays of numpy have in memory what `array` says, by one of which all is known. */
static PyObject *knows_arrays(PyObject *Py_UNUSED(module), PyObject *arguments)
{
    PyObject *example, *type;
    unsigned long long data;
    Py_ssize_t n, m, step, next;
    if (!PyArg_ParseTuple(arguments, "OOKnnnn:knows_arrays", &example, &type, &data, &n, &m, &step, &next)) return NULL;
    const array *given = (const array *)example;
    const int is_so = (size_t)Py_TYPE(example)->tp_basicsize >= sizeof(array) && given->n_axes == 2 &&
                      (uintptr_t)given->data == (uintptr_t)data && given->type == type && given->shape[0] == n &&
                      given->shape[1] == m && given->strides[0] == step && given->strides[1] == next &&
                      given->flags & ALIGNED;
    return PyBool_FromLong(is_so);
}

static PyMethodDef module_methods[] = {
    {"knows_arrays", knows_arrays, METH_VARARGS, "Whether arrays of numpy are in memory as this module thinks."},
    {NULL, NULL, 0, NULL},
};

static int add_type(PyObject *module, const char *name, PyType_Spec *spec)
{
    PyObject *type = PyType_FromModuleAndSpec(module, spec, NULL);
    const int result = type ? PyModule_AddObjectRef(module, name, type) : -1;
    Py_XDECREF(type);
    return result;
}

static int begin_module(PyObject *module)
{
    static int is_registered = 0;
    if (!is_registered) pthread_atfork(NULL, NULL, forget_threads);
    is_registered = 1;
    return add_type(module, "Kernel", &kernel_spec) || add_type(module, "Step", &step_spec) ? -1 : 0;
}

static PyModuleDef_Slot module_slots[] = {{Py_mod_exec, begin_module}, {0, NULL}};
static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, .m_name = "circuitkit_runtime", .m_methods = module_methods,
                                    .m_slots = module_slots, .m_size = 0};

PyMODINIT_FUNC PyInit_circuitkit_runtime(void)
{
    return PyModuleDef_Init(&module);
}
