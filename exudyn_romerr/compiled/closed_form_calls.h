/* What calls the loops in closed_form.h and closed_tangent.h. */

enum { MOVED_ARRAYS = 19, FLOATING_ARRAYS = 17, TANGENT_ARRAYS = 8 };

/* Arrays of arguments behind so many sizes; the last ones, `written`, are for results. Whether they are so long. */
static int take_arrays(PyObject *arguments, Size sizes, Size count, const Size *counts, Size written, Held *held,
                       double **arrays)
{
    for (Size i = 0; i < count; i++) {
        const int flags = i >= count - written ? PyBUF_WRITABLE : 0;
        if (!(arrays[i] = numbers(PyTuple_GET_ITEM(arguments, sizes + i), held, counts[i], 'd', flags))) return 0;
    }
    return 1;
}

/* Read sizes ahead of so many arrays by a format of PyArg_ParseTuple; whether there are so many of each. */
static int take_sizes(PyObject *arguments, Size sizes, Size arrays, const char *format, ...)
{
    PyObject *first = PyTuple_GetSlice(arguments, 0, sizes);
    va_list places;
    va_start(places, format);
    const int are_read = first && PyArg_VaParse(first, format, places);
    va_end(places);
    Py_XDECREF(first);
    if (are_read && PyTuple_GET_SIZE(arguments) == sizes + arrays) return 1;
    if (are_read) PyErr_Format(PyExc_TypeError, "%zd arrays are needed", arrays);
    return 0;
}

#define MOVED \
    "moved_motion(T, j, k, A, w, alpha, b, g, c, c1, c2, e, e1, e2, new_A, new_w, new_alpha, new_b, new_g, new_c,\n" \
    "new_c1, new_c2)\n\nWrite the motion of Motion.moved from A (T, 3, 3), w, alpha, b, g (T, 3), c, c1, c2 (T, j)\n" \
    "and e, e1, e2 (T, 6 + k); the last three that are written are (T, k)."

static PyObject *moved_motion(PyObject *self, PyObject *arguments)
{
    Moved all = {0};
    if (!take_sizes(arguments, 3, MOVED_ARRAYS, "nnn", &all.T, &all.j, &all.k) ||
        !are_sizes(4, all.T, all.j, all.k, (Size)9) || !are_sizes(1, all.k - all.j))
        return NULL;
    const Size T3 = 3 * all.T, j = all.T * all.j, k = all.T * all.k, of_e = 2 * T3 + k;
    const Size counts[] = {3 * T3, T3, T3, T3, T3, j, j, j, of_e, of_e, of_e, 3 * T3, T3, T3, T3, T3, k, k, k};
    double *x[MOVED_ARRAYS], **y = x + 11;
    Py_buffer views[MOVED_ARRAYS];
    Held held = {views, 0};
    PyObject *result = NULL;
    if (take_arrays(arguments, 3, MOVED_ARRAYS, counts, 8, &held, x)) {
        all.from = (Motion){x[0], x[1], x[2], x[3], x[4], {x[5], x[6], x[7]}};
        all.to = (Motion){y[0], y[1], y[2], y[3], y[4], {y[5], y[6], y[7]}};
        memcpy(all.e, x + 8, sizeof(all.e));
        move(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    return result;
}

/* Whether sizes are those of a body and its motion, whose arrays can be that long. */
static int are_sizes_of_body(const Floating *all)
{
    return are_sizes(4, all->T, all->k, all->k, (Size)81) && are_sizes(2, all->j, all->na) &&
           are_sizes(2, all->k - all->j, all->k - all->na);
}

/* Take the arrays of a motion and a body, which all functions of bodies have first. */
static int take_body(PyObject *arguments, Size sizes, Held *held, Floating *all)
{
    const Size T3 = 3 * all->T, j = all->T * all->j, k = all->k, kk = k * k;
    const Size counts[FLOATING_ARRAYS] = {T3, T3, T3, T3, j, j, j, 3, 9, 3 * k, 9 * k, 9 * kk, 3 * kk, kk, kk, kk};
    const double **places[] = {&all->w,  &all->alpha, &all->b,  &all->g, &all->c,      &all->c1, &all->c2, &all->X,
                               &all->XX, &all->Ux,    &all->xU, &all->G, &all->twists, &all->M,  &all->D,  &all->K};
    double *x[FLOATING_ARRAYS];
    if (!take_arrays(arguments, sizes, FLOATING_ARRAYS - 1, counts, 0, held, x)) return 0;
    for (int i = 0; i < FLOATING_ARRAYS - 1; i++) *places[i] = x[i];
    return 1;
}

/* Memory for a loop, and zeros (k,) behind it. */
static int take_work(Floating *all, Size count)
{
    if (!(all->work = PyMem_Calloc(count + all->k + 1, sizeof(double)))) PyErr_NoMemory();
    all->zeros = all->work ? all->work + count : NULL;
    return all->work != NULL;
}

#define OF_BODY \
    "w, alpha, b, g (T, 3), c, c1, c2 (T, j), X (3,), XX (3, 3), Ux (3, k), xU (3, 3, k), G (9, k, k),\n" \
    "twists (3, k, k), M, D, K (k, k) of Motion and Body; twists: G_ij - G_ji of the pairs of a cross product."

#define RESIDUAL \
    "body_residual(T, j, k, mass, w, alpha, b, g, c, c1, c2, X, XX, Ux, xU, G, twists, M, D, K, rows)\n\n" \
    "Write rows (T, 6 + k) of Body.residual from\n" OF_BODY

static PyObject *found_residual(PyObject *self, PyObject *arguments)
{
    Floating all = {0};
    if (!take_sizes(arguments, 4, FLOATING_ARRAYS, "nnnd", &all.T, &all.j, &all.k, &all.mass) || !are_sizes_of_body(&all))
        return NULL;
    const Size count = all.T * (6 + all.k);
    Py_buffer views[FLOATING_ARRAYS];
    Held held = {views, 0};
    PyObject *result = NULL;
    if (take_body(arguments, 4, &held, &all) &&
        take_arrays(arguments, 3 + FLOATING_ARRAYS, 1, &count, 1, &held, &all.rows) &&
        take_work(&all, RESIDUAL_WORK(all.j, all.k))) {
        find_residual(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    PyMem_Free(all.work);
    return result;
}

#define TANGENT \
    "body_tangent(T, j, na, k, mass, w, alpha, b, g, c, c1, c2, X, XX, Ux, xU, G, twists, M, D, K, G_back, new_M,\n" \
    "new_D, new_K, coupled_M, coupled_D, coupled_K, D_back, K_back)\n\n" \
    "Write M, D, K (T, s, s), s = 6 + na, and the coupling (T, s, k - na) of Body.tangent from G_back (9, na, k - na),\n" \
    "the transposes of G[:, na:, :na], and " OF_BODY

static PyObject *found_tangent(PyObject *self, PyObject *arguments)
{
    Tangent all = {.s = 0};
    Floating *body = &all.body;
    if (!take_sizes(arguments, 5, FLOATING_ARRAYS + TANGENT_ARRAYS, "nnnnd", &body->T, &body->j, &body->na, &body->k,
                    &body->mass) ||
        !are_sizes_of_body(body))
        return NULL;
    all.s = 6 + body->na, all.m = body->k - body->na;
    const Size own = body->T * all.s * all.s, coupled = body->T * all.s * all.m, back = 9 * body->na * all.m;
    const Size counts[] = {own, own, own, coupled, coupled, coupled, coupled, coupled};
    double *G_back, *y[TANGENT_ARRAYS];
    Py_buffer views[FLOATING_ARRAYS + TANGENT_ARRAYS];
    Held held = {views, 0};
    PyObject *result = NULL;
    if (take_body(arguments, 5, &held, body) &&
        take_arrays(arguments, 4 + FLOATING_ARRAYS, 1, &back, 0, &held, &G_back) &&
        take_arrays(arguments, 5 + FLOATING_ARRAYS, TANGENT_ARRAYS, counts, TANGENT_ARRAYS, &held, y) &&
        take_work(body, TANGENT_WORK(body->na, body->k))) {
        all.G_back = G_back, all.M = y[0], all.D = y[1], all.K = y[2];
        all.coupled_M = y[3], all.coupled_D = y[4], all.coupled_K = y[5], all.D_back = y[6], all.K_back = y[7];
        find_tangent(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    PyMem_Free(body->work);
    return result;
}
