/* What step_recorder.py does at most steps: store the state. All else is done by a function in Python. */

#define READERS 4 /* of q, q_t, q_tt, and of multipliers, if these are wanted */

typedef struct {
    PyObject_HEAD
    PyObject *slow, *start_of_step, *start, *current, *readers[READERS], *hook;
    Py_buffer rows[1 + READERS]; /* times, and what readers give */
    Py_buffer states[READERS]; /* where the solver has what readers give, as it was found last */
    Size arrays, first, stored, last; /* arrays that are held; rows before, rows now, the row that Python stores again */
    double end; /* time from which on Python stores */
} Recorder;

static void release_states(Recorder *self)
{
    for (Size i = 0; i < READERS; i++) PyBuffer_Release(self->states + i); /* of none: does nothing */
}

static void release_rows(Recorder *self)
{
    self->last = 0;
    release_states(self);
    while (self->arrays) PyBuffer_Release(self->rows + --self->arrays);
}

/* Find what a reader gives, without a copy of it; -1 with an error set if it is not of the size of a row. */
static int look(Recorder *self, Size i, Py_buffer *found)
{
    PyObject *arguments[] = {self->current, Py_False}, *given = PyObject_Vectorcall(self->readers[i], arguments, 2, NULL);
    if (given == NULL) return -1;
    const int failed = PyObject_GetBuffer(given, found, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT);
    Py_DECREF(given);
    if (failed) return -1;
    const Size bytes = self->rows[1 + i].shape[1] * sizeof(double);
    if (found->len == bytes && are_of(found, 'd')) return 0;
    PyErr_Format(PyExc_ValueError, "a state of %zd bytes in place of %zd", found->len, bytes);
    PyBuffer_Release(found);
    return -1;
}

/* Whether a state is where it was; it is held, so that nothing else can be there. -1 with an error set. */
static int stays(Recorder *self, Size i)
{
    Py_buffer now;
    if (self->states[i].obj == NULL) return 0;
    if (look(self, i, &now) < 0) return -1;
    const int same = now.buf == self->states[i].buf;
    PyBuffer_Release(&now);
    return same;
}

/* Copy states into row `self->stored`; -1 with an error set. Two are looked for at every step, coordinates and
multipliers: Exudyn gives rates memory anew only where it does so for coordinates. */
static int store(Recorder *self)
{
    const Size count = self->arrays - 1;
    int same = stays(self, 0);
    if (same == 1 && count == READERS) same = stays(self, READERS - 1);
    if (same < 0) return -1;
    if (!same) {
        release_states(self);
        for (Size i = 0; i < count; i++)
            if (look(self, i, self->states + i) < 0) {
                release_states(self);
                return -1;
            }
    }
    for (Size i = 0; i < count; i++) {
        const Size bytes = self->states[i].len;
        memcpy((char *)self->rows[1 + i].buf + self->stored * bytes, self->states[i].buf, bytes);
    }
    return 0;
}

/* The PostStep function, of mbs and t. */
static PyObject *recorded(Recorder *self, PyObject *arguments, PyObject *names)
{
    if (self->stored < self->last && PyTuple_GET_SIZE(arguments) == 2) {
        const double t = PyFloat_AsDouble(PyTuple_GET_ITEM(arguments, 1));
        PyObject *given = PyObject_CallOneArg(self->start_of_step, self->start);
        if (given == NULL) return NULL;
        const double start = PyFloat_AsDouble(given);
        Py_DECREF(given);
        if (PyErr_Occurred()) return NULL;
        if (start != t && t < self->end) { /* they are equal at the first call of a solve */
            if (store(self) < 0) return NULL;
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
    if (!are_sizes(2, first, last)) return NULL;
    for (; self->arrays <= READERS && arrays[self->arrays]; self->arrays++) {
        Py_buffer *rows = self->rows + self->arrays;
        if (PyObject_GetBuffer(arrays[self->arrays], rows, PyBUF_C_CONTIGUOUS | PyBUF_WRITABLE | PyBUF_FORMAT) < 0) return NULL;
        if (rows->ndim != 1 + (self->arrays > 0) || !are_of(rows, 'd') || rows->shape[0] < last) {
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
    PyObject *given[4 + READERS];
    if (!PyArg_ParseTuple(arguments, "OOOOOOOO", given, given + 1, given + 2, given + 3, given + 4, given + 5, given + 6,
                          given + 7))
        return -1;
    PyObject **kept[] = {&self->slow,       &self->start_of_step, &self->start,      &self->current,
                         self->readers,     self->readers + 1,    self->readers + 2, self->readers + 3};
    for (Size i = 0; i < 4 + READERS; i++) Py_XSETREF(*kept[i], Py_NewRef(given[i]));
    return 0;
}

static int recorder_traverse(Recorder *self, visitproc visit, void *arg)
{
    Py_VISIT(self->slow);
    Py_VISIT(self->start_of_step);
    Py_VISIT(self->start);
    Py_VISIT(self->current);
    Py_VISIT(self->hook);
    for (Size i = 0; i < READERS; i++) Py_VISIT(self->readers[i]);
    for (Size i = 0; i < READERS; i++) Py_VISIT(self->states[i].obj);
    for (Size i = 0; i < self->arrays; i++) Py_VISIT(self->rows[i].obj);
    return 0;
}

static int recorder_clear(Recorder *self)
{
    release_rows(self);
    Py_CLEAR(self->slow);
    Py_CLEAR(self->start_of_step);
    Py_CLEAR(self->start);
    Py_CLEAR(self->current);
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
    .tp_doc = "Recorder(slow, start_of_step, start, current, q, q_t, q_tt, multipliers)\n\nPostStep function: slow(mbs, t) "
              "at a step where start_of_step(start) is t, or all rows it may store are; else it stores what the others "
              "return, of (current, False): memory of the solver, or a copy.",
    .tp_new = PyType_GenericNew,
    .tp_init = (initproc)recorder_init,
    .tp_dealloc = (destructor)recorder_free,
    .tp_traverse = (traverseproc)recorder_traverse,
    .tp_clear = (inquiry)recorder_clear,
    .tp_call = (ternaryfunc)recorded,
    .tp_methods = recorder_methods,
    .tp_members = recorder_members,
};
