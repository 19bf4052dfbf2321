/* Calls from Python of mechanism_march.h, mechanism_factors.h, flow.h and inverses.h. */

static void march_mechanism_anywhere(const Mechanism *all) { march_mechanism(all); }
static Size flow_anywhere(const Flow *all) { return flow(all); }
static Size invert_bordered_anywhere(const Bordered *all) { return invert_bordered(all); }
static void make_matrices_anywhere(const StepMatrices *all) { make_matrices(all); }
static void (*march_mechanism_here)(const Mechanism *) = march_mechanism_anywhere;
static Size (*flow_here)(const Flow *) = flow_anywhere;
static Size (*invert_bordered_here)(const Bordered *) = invert_bordered_anywhere;
static void (*make_matrices_here)(const StepMatrices *) = make_matrices_anywhere;

#ifdef WIDE
WIDE static void march_mechanism_wide(const Mechanism *all) { march_mechanism(all); }
WIDE static Size flow_wide(const Flow *all) { return flow(all); }
WIDE static Size invert_bordered_wide(const Bordered *all) { return invert_bordered(all); }
WIDE static void make_matrices_wide(const StepMatrices *all) { make_matrices(all); }
#endif

#define MARCH_ARRAYS 12
#define BODY_ARRAYS 10
#define MECHANISM                                                                                                      \
    "march_mechanism((T, n, n_a, c, columns, orders, first_order), scheme, starts, bodies, arrays, (x, p, e, l))\n\nMarch.__call__ "   \
    "of mechanism/march.py: write e (T, 3, n, columns) and l (T, c, columns), go on with x (4, n, columns) and p (4, "    \
    "nodes, 4, columns)."

static int body_of(PyObject *given, const Mechanism *all, Oscillating *body, Held *held)
{
    PyObject *of[BODY_ARRAYS];
    if (!PyArg_ParseTuple(given, "nnnnOOOOOOOOOO", &body->first, &body->s, &body->wave, &body->m, of, of + 1, of + 2,
                          of + 3, of + 4, of + 5, of + 6, of + 7, of + 8, of + 9))
        return -1;
    const Size whole = all->T * body->s * body->m, many[BODY_ARRAYS] = {whole, whole, whole, whole, whole, whole, whole,
                                                                        all->T * body->m, body->m, body->m};
    if (!are_sizes(3, all->T, body->s, body->m) || body->s < 6 || body->first < 0 || body->wave < all->n_a ||
        body->first + body->s > all->n_a || body->wave + body->m > all->n) {
        PyErr_SetString(PyExc_ValueError, "a body has unknowns or oscillators that there are not");
        return -1;
    }
    const double **into[BODY_ARRAYS] = {&body->M,  &body->D,    &body->K,    &body->D_back,  &body->K_back,
                                        &body->up, &body->down, &body->soft, &body->springs, &body->dampers};
    for (int i = 0; i < BODY_ARRAYS; i++) {
        const int is_made = i >= 5 && i < 8; /* by step_matrices() */
        if (!(*into[i] = numbers(of[i], held, many[i], 'd', is_made ? PyBUF_WRITABLE : 0))) return -1;
    }
    return 0;
}

/* Bodies, and where rotations of nodes are, which a mechanism's sizes are known of. */
static int parts_of(PyObject *starts, PyObject *bodies, Mechanism *all, Oscillating *body, Held *held)
{
    if (!(all->spin = numbers(starts, held, all->nodes, 'q', 0))) return -1;
    int is_none = all->nodes < all->bodies;
    for (Size b = 0; b < all->nodes; b++) is_none |= all->spin[b] < 0 || all->spin[b] + 3 > all->n_a;
    if (is_none) {
        PyErr_SetString(PyExc_ValueError, "a node has rotations that there are not");
        return -1;
    }
    for (Size b = 0; b < all->bodies; b++)
        if (body_of(PyList_GET_ITEM(bodies, b), all, body + b, held) < 0) return -1;
    return 0;
}

static int mechanism_of(PyObject *scheme, PyObject *starts, PyObject *bodies, PyObject *const *given,
                        PyObject *const *written, Mechanism *all, Oscillating *body, Held *held)
{
    const Size T = all->T, n_a = all->n_a, k = all->k, w = n_a + k, c = all->c, square = T * n_a * n_a;
    const Size many[MARCH_ARRAYS] = {T, T, T, square, square, square, T * k * n_a, T * w * w, all->orders * square,
                                     T * all->n * c, T * k * c, T * all->nodes * 70};
    const double **into[MARCH_ARRAYS - 1] = {&all->h, &all->c1,      &all->c2,      &all->M, &all->D, &all->K,
                                             &all->C, &all->inverse, &all->sampled, &all->f, &all->g};
    const int last = MARCH_ARRAYS - 1;
    for (int i = 0; i < last; i++)
        if (!(*into[i] = numbers(given[i], held, many[i], 'd', 0))) return -1;
    if (!(all->turns = numbers(given[last], held, many[last], 'd', 0)) ||
        !(all->scheme = numbers(scheme, held, 4, 'd', 0)) ||
        !(all->x = numbers(written[0], held, 4 * all->n * c, 'd', PyBUF_WRITABLE)) ||
        !(all->y = numbers(written[1], held, 16 * all->nodes * c, 'd', PyBUF_WRITABLE)) ||
        !(all->e = numbers(written[2], held, 3 * T * all->n * c, 'd', PyBUF_WRITABLE)) ||
        !(all->l = numbers(written[3], held, T * k * c, 'd', PyBUF_WRITABLE)))
        return -1;
    return parts_of(starts, bodies, all, body, held);
}

static PyObject *mechanism_marched(PyObject *self, PyObject *arguments)
{
    Mechanism all = {0};
    PyObject *scheme, *starts, *bodies, *given[MARCH_ARRAYS], *written[4], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "(nnnnnnn)OOO!(OOOOOOOOOOOO)(OOOO)", &all.T, &all.n, &all.n_a, &all.k, &all.c, &all.orders,
                          &all.first_order, &scheme, &starts, &PyList_Type, &bodies, given, given + 1, given + 2, given + 3, given + 4,
                          given + 5, given + 6, given + 7, given + 8, given + 9, given + 10, given + 11, written, written + 1,
                          written + 2, written + 3))
        return NULL;
    const Size nodes = PyObject_Length(starts);
    if (nodes < 0 || !are_sizes(5, all.T, all.n + all.k, all.n_a + all.k, all.c + 1, 70 * (nodes + 1)) ||
        !are_sizes(3, all.n, all.n_a, all.k) || all.n_a > all.n || all.orders < 0 || all.orders > 2 ||
        all.first_order < 0 || all.first_order > all.n_a)
        return PyErr_Occurred() ? NULL : PyErr_Format(PyExc_ValueError, "more unknowns than there are");
    all.nodes = nodes, all.bodies = PyList_GET_SIZE(bodies);
    Held held = {PyMem_Calloc(MARCH_ARRAYS + 6 + BODY_ARRAYS * all.bodies, sizeof(Py_buffer)), 0};
    Oscillating *body = PyMem_Calloc(all.bodies + 1, sizeof(Oscillating));
    all.body = body, all.work = PyMem_Calloc(march_work(&all) + 1, sizeof(double));
    if (!held.views || !body || !all.work) PyErr_NoMemory();
    else if (mechanism_of(scheme, starts, bodies, given, written, &all, body, &held) == 0) {
        march_mechanism_here(&all);
        result = Py_NewRef(Py_None);
    }
    if (held.views) release(&held);
    PyMem_Free(held.views), PyMem_Free(body), PyMem_Free(all.work);
    return result;
}

#define MATRICES                                                                                                       \
    "step_matrices((T, n, n_a), starts, bodies, (c1, c2, M, D, K, turns), A)\n\nfactors_of of "                        \
    "mechanism_errors/factors.py: write A (T, n_a, n_a), and up, down, soft of bodies."

static PyObject *matrices_made(PyObject *self, PyObject *arguments)
{
    Mechanism all = {0};
    PyObject *starts, *bodies, *given[6], *A, *result = NULL;
    if (!PyArg_ParseTuple(arguments, "(nnn)OO!(OOOOOO)O", &all.T, &all.n, &all.n_a, &starts, &PyList_Type, &bodies, given,
                          given + 1, given + 2, given + 3, given + 4, given + 5, &A))
        return NULL;
    const Size nodes = PyObject_Length(starts);
    if (nodes < 0 || !are_sizes(4, all.T, all.n, all.n, 70 * (nodes + 1)) || !are_sizes(2, all.n_a, all.n - all.n_a))
        return NULL;
    all.nodes = nodes, all.bodies = PyList_GET_SIZE(bodies);
    const Size square = all.T * all.n_a * all.n_a, many[6] = {all.T, all.T, square, square, square, all.T * nodes * 70};
    const double *x[6];
    Held held = {PyMem_Calloc(8 + BODY_ARRAYS * all.bodies, sizeof(Py_buffer)), 0};
    Oscillating *body = PyMem_Calloc(all.bodies + 1, sizeof(Oscillating));
    StepMatrices made = {&all, NULL, NULL};
    all.body = body;
    int is_ready = held.views && body;
    if (!is_ready) PyErr_NoMemory();
    for (int i = 0; i < 6 && is_ready; i++) is_ready = (x[i] = numbers(given[i], &held, many[i], 'd', 0)) != NULL;
    is_ready = is_ready && (made.A = numbers(A, &held, square, 'd', PyBUF_WRITABLE)) &&
               parts_of(starts, bodies, &all, body, &held) == 0;
    if (is_ready && !(made.work = PyMem_Calloc(matrices_work(&all) + 1, sizeof(double)))) PyErr_NoMemory();
    else if (is_ready) {
        all.c1 = x[0], all.c2 = x[1], all.M = x[2], all.D = x[3], all.K = x[4], all.turns = (const Turn *)x[5];
        make_matrices_here(&made);
        result = Py_NewRef(Py_None);
    }
    if (held.views) release(&held);
    PyMem_Free(held.views), PyMem_Free(body), PyMem_Free(made.work);
    return result;
}

#define TURNED                                                                                                         \
    "turn_frames(T, n, m, row, column, A, X)\n\nTurn a frame's six rows and columns of X (T, n, m), two vectors from "  \
    "`row` and `column` on, by A (T, 3, 3);\n-1: none."

static PyObject *frames_turned(PyObject *self, PyObject *arguments)
{
    Turned all = {0};
    PyObject *A, *X, *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnnnnOO", &all.T, &all.n, &all.m, &all.row, &all.column, &A, &X) ||
        !are_sizes(4, all.T, all.n, all.m, (Size)9))
        return NULL;
    if (all.row < -1 || all.column < -1 || (all.row >= 0 && all.row + 6 > all.n) ||
        (all.column >= 0 && all.column + 6 > all.m))
        return PyErr_Format(PyExc_ValueError, "a frame has rows or columns that there are not");
    Py_buffer views[2];
    Held held = {views, 0};
    if ((all.A = numbers(A, &held, 9 * all.T, 'd', 0)) &&
        (all.X = numbers(X, &held, all.T * all.n * all.m, 'd', PyBUF_WRITABLE))) {
        turn_frames(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    return result;
}

#define FLOW_ARRAYS 9
#define FLOW                                                                                                           \
    "flow((T, n, c, columns, m, terms), (centre, scale, back), arrays, e, ends)\n\nby_series of mechanism_errors/flow.py: write "  \
    "ends (T, columns, 2 n), go on with e (columns, 2 n); return of how many steps."

static PyObject *flowed(PyObject *self, PyObject *arguments)
{
    Flow all = {0};
    PyObject *given[FLOW_ARRAYS], *e, *ends, *result = NULL;
    if (!PyArg_ParseTuple(arguments, "(nnnnnn)(ddd)(OOOOOOOOO)OO", &all.T, &all.n, &all.k, &all.c, &all.m, &all.terms,
                          &all.centre, &all.scale, &all.back, given, given + 1, given + 2, given + 3, given + 4, given + 5, given + 6,
                          given + 7, given + 8, &e, &ends) ||
        !are_sizes(5, all.T, 2 * all.n + all.k, 2 * all.n + all.k, all.c + 1, 8 * (all.m + 1)) ||
        !are_sizes(4, all.n, all.k, all.m, all.terms))
        return NULL;
    if (all.m > LOAD_TERMS || all.terms < 2)
        return PyErr_Format(PyExc_ValueError, "too many terms of loads, or no series");
    const Size T = all.T, n = all.n, k = all.k;
    const Size many[FLOW_ARRAYS] = {T, T * 2 * n * n, T * 2 * n, T * 2 * n, all.c * T * all.m * n, T * k * n, T * k * n,
                                    T * n * k, all.terms};
    const double **into[FLOW_ARRAYS] = {&all.h, &all.A, &all.y, &all.z, &all.loads, &all.C, &all.C1, &all.W,
                                        &all.factors};
    Py_buffer views[FLOW_ARRAYS + 2];
    Held held = {views, 0};
    int is_ready = 1;
    for (int i = 0; i < FLOW_ARRAYS && is_ready; i++)
        is_ready = (*into[i] = numbers(given[i], &held, many[i], 'd', 0)) != NULL;
    is_ready = is_ready && (all.e = numbers(e, &held, all.c * 2 * n, 'd', PyBUF_WRITABLE)) &&
               (all.ends = numbers(ends, &held, T * all.c * 2 * n, 'd', PyBUF_WRITABLE));
    if (is_ready && !(all.work = PyMem_Calloc(flow_work(&all) + 1, sizeof(double)))) PyErr_NoMemory();
    else if (is_ready) result = PyLong_FromSsize_t(flow_here(&all));
    release(&held), PyMem_Free(all.work);
    return result;
}

#define BORDERED                                                                                                       \
    "bordered_inverses(T, n, c, least, A, G, C, out)\n\nWrite inverses (T, n + c, n + c) of [[A, G^T], [C, 0]]; "       \
    "return how many have one: T, or the first without."

static PyObject *bordered_inverted(PyObject *self, PyObject *arguments)
{
    Bordered all = {0};
    PyObject *given[4], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnndOOOO", &all.T, &all.n, &all.c, &all.least, given, given + 1, given + 2,
                          given + 3) ||
        !are_sizes(3, all.T, all.n + all.c, all.n + all.c) || !are_sizes(2, all.n, all.c))
        return NULL;
    const Size w = all.n + all.c, square = all.T * all.n * all.n, border = all.T * all.c * all.n;
    Py_buffer views[4];
    Held held = {views, 0};
    all.scale = PyMem_Calloc(w + 1, sizeof(double)), all.order = PyMem_Calloc(w + 1, sizeof(Size));
    if (!all.scale || !all.order) PyErr_NoMemory();
    else if ((all.A = numbers(given[0], &held, square, 'd', 0)) && (all.G = numbers(given[1], &held, border, 'd', 0)) &&
             (all.C = numbers(given[2], &held, border, 'd', 0)) &&
             (all.out = numbers(given[3], &held, all.T * w * w, 'd', PyBUF_WRITABLE)))
        result = PyLong_FromSsize_t(invert_bordered_here(&all));
    release(&held), PyMem_Free(all.scale), PyMem_Free(all.order);
    return result;
}
