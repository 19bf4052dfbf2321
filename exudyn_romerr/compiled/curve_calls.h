/* What calls the loops in curves.h. */

#define CURVES                                                                                                         \
    "curves(S, n, p, alpha, beta, h, q, q_t, q_tt, u, controls, ends, y)\n\nWrite y (S, 6, 2 n + p): control points "     \
    "between samples q, q_t, q_tt (S + 1, n),\nu (S + 1, p), ends (S + 1, 2 n + p), h (S,) apart. controls (S, 6, p): "    \
    "of u, None: straight lines.\nhermite_rows tells the rest."

static PyObject *curved(PyObject *self, PyObject *arguments)
{
    Curves all = {0};
    PyObject *given[8], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnnddOOOOOOOO", &all.S, &all.n, &all.p, &all.alpha, &all.beta, given, given + 1,
                          given + 2, given + 3, given + 4, given + 5, given + 6, given + 7) ||
        !are_sizes(3, all.S, all.n, all.p))
        return NULL;
    Py_buffer views[8];
    Held held = {views, 0};
    const Size S = all.S, n = all.n, p = all.p, samples = (S + 1) * n, row = 2 * n + p;
    if (!(all.z = PyMem_Calloc(POINTS * 2 * n + 1, sizeof(double)))) {
        PyErr_NoMemory();
    } else if ((all.h = numbers(given[0], &held, S, 'd', 0)) && (all.q = numbers(given[1], &held, samples, 'd', 0)) &&
               (all.q_t = numbers(given[2], &held, samples, 'd', 0)) &&
               (all.q_tt = numbers(given[3], &held, samples, 'd', 0)) &&
               (all.u = numbers(given[4], &held, (S + 1) * p, 'd', 0)) &&
               (given[5] == Py_None || (all.controls = numbers(given[5], &held, S * POINTS * p, 'd', 0))) &&
               (all.ends = numbers(given[6], &held, (S + 1) * row, 'd', 0)) &&
               (all.y = numbers(given[7], &held, S * POINTS * row, 'd', PyBUF_WRITABLE))) {
        draw_here(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    PyMem_Free(all.z);
    return result;
}

#define LENGTHS                                                                                                     \
    "lengths(S, d, k, m, c, columns, y)\n\nWrite y (S,), lengths of polygons c (S, d + 1, k) as columns (m, k) of a " \
    "matrix make them.\nReturn whether no square lost digits."

static PyObject *measured(PyObject *self, PyObject *arguments)
{
    Lengths all = {0};
    Size m;
    const double *columns;
    PyObject *given[3], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnnnOOO", &all.S, &all.d, &all.k, &m, given, given + 1, given + 2) ||
        !are_sizes(4, all.S, all.d, all.k, m))
        return NULL;
    Py_buffer views[3];
    Held held = {views, 0};
    Squares *squares = &all.squares;
    const Size rows = STEPS * all.d, k = squares->k = all.k;
    squares->blocks = (m + WIDTH * LANES - 1) / (WIDTH * LANES);
    double *work = PyMem_Calloc(rows * (k + 1) + squares->blocks * k * WIDTH * LANES + 1, sizeof(double));
    squares->begins = PyMem_Calloc(squares->blocks + 1, sizeof(Size));
    if (!work || !squares->begins) {
        PyErr_NoMemory();
    } else if ((all.c = numbers(given[0], &held, all.S * (all.d + 1) * k, 'd', 0)) &&
               (columns = numbers(given[1], &held, m * k, 'd', 0)) &&
               (all.y = numbers(given[2], &held, all.S, 'd', PyBUF_WRITABLE))) {
        squares->rows = all.rows = work, squares->y = work + rows * k, squares->columns = squares->y + rows;
        arrange(squares, m, columns);
        result = PyBool_FromLong(measure_here(&all));
    }
    release(&held);
    PyMem_Free(work), PyMem_Free(squares->begins);
    return result;
}

#define INSIDE                                                                                                       \
    "inside(S, points, m, omega, h, before, F, y)\n\nWrite y (S, 2, m) of ModalOscillators.inside, which tells the " \
    "rest: omega (m,), h (S,), states before (S, 2, m), F (S, points, m)."

static PyObject *looked_inside(PyObject *self, PyObject *arguments)
{
    Inside all = {0};
    PyObject *given[5], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnnOOOOO", &all.S, &all.points, &all.m, given, given + 1, given + 2, given + 3,
                          given + 4) ||
        !are_sizes(4, all.S, all.points, all.points - 1, all.m))
        return NULL;
    Py_buffer views[5];
    Held held = {views, 0};
    const Size S = all.S, m = all.m, size = sizeof(double);
    if (!(all.largest = PyMem_Calloc(3 * m + 1, size))) {
        PyErr_NoMemory();
    } else if ((all.omega = numbers(given[0], &held, m, 'd', 0)) && (all.h = numbers(given[1], &held, S, 'd', 0)) &&
               (all.before = numbers(given[2], &held, S * 2 * m, 'd', 0)) &&
               (all.F = numbers(given[3], &held, S * all.points * m, 'd', 0)) &&
               (all.y = numbers(given[4], &held, S * 2 * m, 'd', PyBUF_WRITABLE))) {
        all.varied = all.largest + m, all.mean = all.varied + m;
        look_inside_here(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    PyMem_Free(all.largest);
    return result;
}

#define INTERPOLATE                                                                                                  \
    "interpolate(S, p, first, last, values, from_nodes, at_checks, controls, largest, summed)\n\nWrite controls (S, 6, " \
    "p) of interpolants of values (S, 9, p) at checks and nodes in turn, with ends first, last\n(S, p); largest, " \
    "summed (S, p): what they miss at checks. Return the largest size at a node."

static PyObject *interpolated(PyObject *self, PyObject *arguments)
{
    Interpolants all = {0};
    PyObject *given[8], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnOOOOOOOO", &all.S, &all.p, given, given + 1, given + 2, given + 3, given + 4,
                          given + 5, given + 6, given + 7) ||
        !are_sizes(3, all.S, (Size)(INNER + CHECKED), all.p))
        return NULL;
    Py_buffer views[8];
    Held held = {views, 0};
    const Size ends = all.S * all.p;
    if ((all.first = numbers(given[0], &held, ends, 'd', 0)) && (all.last = numbers(given[1], &held, ends, 'd', 0)) &&
        (all.values = numbers(given[2], &held, ends * (INNER + CHECKED), 'd', 0)) &&
        (all.from_nodes = numbers(given[3], &held, POINTS * POINTS, 'd', 0)) &&
        (all.at_checks = numbers(given[4], &held, CHECKED * POINTS, 'd', 0)) &&
        (all.controls = numbers(given[5], &held, ends * POINTS, 'd', PyBUF_WRITABLE)) &&
        (all.largest = numbers(given[6], &held, ends, 'd', PyBUF_WRITABLE)) &&
        (all.summed = numbers(given[7], &held, ends, 'd', PyBUF_WRITABLE)))
        result = PyFloat_FromDouble(interpolate_here(&all));
    release(&held);
    return result;
}
