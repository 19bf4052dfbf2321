/* What step_recorder.py does at most steps: store the state. All else is done by a function in Python. */

#define READERS 4 /* of q, q_t, q_tt, and of multipliers, if these are wanted */

typedef struct {
    PyObject_HEAD
    PyObject *slow, *start_of_step, *configuration, *readers[READERS], *hook;
    Py_buffer rows[1 + READERS]; /* times, and what readers give */
    Size arrays, first, stored, last; /* arrays that are held; rows before, rows now, the row that Python stores again */
    double end; /* time from which on Python stores */
} Recorder;

static void release_rows(Recorder *self)
{
    self->last = 0;
    while (self->arrays) PyBuffer_Release(self->rows + --self->arrays);
}

/* Copy what a reader gives into row `self->stored` of an array; -1 with an error set if it is of another size. */
static int store(Recorder *self, PyObject *reader, const Py_buffer *rows)
{
    PyObject *given = PyObject_CallNoArgs(reader);
    if (given == NULL) return -1;
    Py_buffer view;
    int failed = PyObject_GetBuffer(given, &view, PyBUF_C_CONTIGUOUS);
    if (!failed) {
        const Size bytes = rows->shape[1] * sizeof(double);
        if (view.len == bytes && view.itemsize == sizeof(double)) {
            memcpy((char *)rows->buf + self->stored * bytes, view.buf, bytes);
        } else {
            PyErr_Format(PyExc_ValueError, "a state of %zd bytes in place of %zd", view.len, bytes);
            failed = -1;
        }
        PyBuffer_Release(&view);
    }
    Py_DECREF(given);
    return failed;
}

/* The PostStep function, of mbs and t. */
static PyObject *recorded(Recorder *self, PyObject *arguments, PyObject *names)
{
    if (self->stored < self->last && PyTuple_GET_SIZE(arguments) == 2) {
        const double t = PyFloat_AsDouble(PyTuple_GET_ITEM(arguments, 1));
        PyObject *given = PyObject_CallOneArg(self->start_of_step, self->configuration);
        if (given == NULL) return NULL;
        const double start = PyFloat_AsDouble(given);
        Py_DECREF(given);
        if (PyErr_Occurred()) return NULL;
        if (start != t && t < self->end) { /* they are equal at the first call of a solve */
            for (Size i = 1; i < self->arrays; i++)
                if (store(self, self->readers[i - 1], self->rows + i) < 0) return NULL;
            ((double *)self->rows->buf)[self->stored++] = t;
            Py_RETURN_TRUE;
        }
    }
    return PyObject_Call(self->slow, arguments, names);
}

static PyObject *go_on(Recorder *self, PyObject *arguments)
{
    PyObject *arrays[1 + READERS] = {NULL};
    Size first, last;
    double end;
    if (!PyArg_ParseTuple(arguments, "nndOO|OOO", &first, &last, &end, arrays, arrays + 1, arrays + 2, arrays + 3,
                          arrays + 4))
        return NULL;
    release_rows(self);
    for (; self->arrays <= READERS && arrays[self->arrays]; self->arrays++) {
        Py_buffer *rows = self->rows + self->arrays;
        if (PyObject_GetBuffer(arrays[self->arrays], rows, PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE) < 0) return NULL;
        if (rows->ndim != 1 + (self->arrays > 0) || rows->itemsize != sizeof(double) || rows->shape[0] < last) {
            PyBuffer_Release(rows);
            return PyErr_Format(PyExc_ValueError, "array %zd does not hold %zd rows", self->arrays, last);
        }
    }
    self->first = self->stored = first, self->last = last, self->end = end;
    Py_RETURN_NONE;
}

static PyObject *stop(Recorder *self, PyObject *none)
{
    const Size more = self->stored - self->first;
    release_rows(self);
    self->first = self->stored;
    return PyLong_FromSsize_t(more);
}

static int recorder_init(Recorder *self, PyObject *arguments, PyObject *names)
{
    PyObject *given[3 + READERS];
    if (!PyArg_ParseTuple(arguments, "OOOOOOO", given, given + 1, given + 2, given + 3, given + 4, given + 5, given + 6))
        return -1;
    PyObject **kept[] = {&self->slow, &self->start_of_step, &self->configuration, self->readers, self->readers + 1,
                         self->readers + 2, self->readers + 3};
    for (Size i = 0; i < 3 + READERS; i++) Py_XSETREF(*kept[i], Py_NewRef(given[i]));
    return 0;
}

static int recorder_traverse(Recorder *self, visitproc visit, void *arg)
{
    Py_VISIT(self->slow);
    Py_VISIT(self->start_of_step);
    Py_VISIT(self->configuration);
    Py_VISIT(self->hook);
    for (Size i = 0; i < READERS; i++) Py_VISIT(self->readers[i]);
    for (Size i = 0; i < self->arrays; i++) Py_VISIT(self->rows[i].obj);
    return 0;
}

static int recorder_clear(Recorder *self)
{
    release_rows(self);
    Py_CLEAR(self->slow);
    Py_CLEAR(self->start_of_step);
    Py_CLEAR(self->configuration);
    Py_CLEAR(self->hook);
    for (Size i = 0; i < READERS; i++) Py_CLEAR(self->readers[i]);
    return 0;
}

static void recorder_free(Recorder *self)
{
    PyObject_GC_UnTrack(self);
    recorder_clear(self);
    Py_TYPE(self)->tp_free((PyObject *)self);
}

static PyMethodDef recorder_methods[] = {
    {"go_on", (PyCFunction)go_on, METH_VARARGS,
     "go_on(first, last, end, times, *arrays)\n\nStore rows from `first` on, before row `last` and time `end`."},
    {"stop", (PyCFunction)stop, METH_NOARGS, "Return how many rows were stored since it was asked, and store none any more."},
    {NULL, NULL, 0, NULL}};

static PyMemberDef recorder_members[] = {{"hook", T_OBJECT, offsetof(Recorder, hook), 0, "who is told of steps"},
                                         {NULL, 0, 0, 0, NULL}};

static PyTypeObject RecorderType = {
    PyVarObject_HEAD_INIT(NULL, 0).tp_name = "exudyn_romerr.compiled._loops.Recorder",
    .tp_basicsize = sizeof(Recorder),
    .tp_flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC,
    .tp_doc = "Recorder(slow, start_of_step, configuration, q, q_t, q_tt, multipliers)\n\nPostStep function: slow(mbs, "
              "t) at a step where start_of_step(configuration) is t, or all rows it may store are; else it stores what "
              "the others return.",
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)recorder_init,
    .tp_dealloc = (destructor)recorder_free,
    .tp_traverse = (traverseproc)recorder_traverse,
    .tp_clear = (inquiry)recorder_clear,
    .tp_call = (ternaryfunc)recorded,
    .tp_methods = recorder_methods,
    .tp_members = recorder_members,
};
