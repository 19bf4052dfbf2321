/* What calls the loops in products.h. */

#define PRODUCTS                                                                                                   \
    "rows_times(S, k, m, rows, columns, y)\n\nWrite y (S, m), products of rows (S, k) with columns (m, k) of a "  \
    "matrix, one behind the other."

static PyObject *multiplied(PyObject *self, PyObject *arguments)
{
    Products all = {0};
    PyObject *given[3], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnnOOO", &all.S, &all.k, &all.m, given, given + 1, given + 2) ||
        !are_sizes(3, all.S, all.k, all.m))
        return NULL;
    Py_buffer views[3];
    Held held = {views, 0};
    if ((all.rows = numbers(given[0], &held, all.S * all.k, 'd', 0)) &&
        (all.columns = numbers(given[1], &held, all.m * all.k, 'd', 0)) &&
        (all.y = numbers(given[2], &held, all.S * all.m, 'd', PyBUF_WRITABLE))) {
        multiply_here(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    return result;
}

#define LARGEST_SIZES "largest_sizes(S, k, rows, y)\n\nWrite y (k,), the largest size of every entry of rows (S, k)."

static PyObject *sized(PyObject *self, PyObject *arguments)
{
    Sizes all = {0};
    PyObject *given[2], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnOO", &all.S, &all.k, given, given + 1) || !are_sizes(2, all.S, all.k))
        return NULL;
    Py_buffer views[2];
    Held held = {views, 0};
    if ((all.rows = numbers(given[0], &held, all.S * all.k, 'd', 0)) &&
        (all.y = numbers(given[1], &held, all.k, 'd', PyBUF_WRITABLE))) {
        find_largest_here(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    return result;
}

#define SUMS                                                                                                       \
    "decaying_sums(rows, S, decays, added, starts, y)\n\nWrite y (rows, S), y_k = decays_k y_k-1 + added_k (rows, S) " \
    "from starts (rows,) on; inf from the first number on\nthat is not finite."

static PyObject *summed_up(PyObject *self, PyObject *arguments)
{
    Sums all = {0};
    PyObject *given[4], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnOOOO", &all.rows, &all.S, given, given + 1, given + 2, given + 3) ||
        !are_sizes(2, all.rows, all.S))
        return NULL;
    Py_buffer views[4];
    Held held = {views, 0};
    const Size count = all.rows * all.S;
    if ((all.decays = numbers(given[0], &held, count, 'd', 0)) && (all.added = numbers(given[1], &held, count, 'd', 0)) &&
        (all.starts = numbers(given[2], &held, all.rows, 'd', 0)) &&
        (all.y = numbers(given[3], &held, count, 'd', PyBUF_WRITABLE))) {
        sum_up(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    return result;
}
