/* The loop of Steps.march (march.py), where all columns share the reading of a step's matrices.

Optional: march.py has the same in NumPy, which sums products in another order; tests compare both. Arrays come as
buffers, so that building this needs nothing but Python. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <string.h>

#define LANES 4    /* numbers of a row at once */
#define TOGETHER 4 /* columns at once: with two rows, their sums stay in registers */

#if defined(__GNUC__) /* Clang, too */
#define INLINE static inline __attribute__((always_inline))
#define UNROLLED _Pragma("GCC unroll 8")
#define PREFETCH(place) __builtin_prefetch(place)
typedef double Lanes __attribute__((vector_size(32)));
#define ADD_PRODUCT(sum, a, b) sum += a * b
#if defined(__x86_64__)
#define WIDE __attribute__((target("avx2,fma")))
#endif
#else
#define INLINE static __forceinline
#define UNROLLED
#define PREFETCH(place)
typedef struct {
    double of[LANES];
} Lanes;
#define ADD_PRODUCT(sum, a, b) \
    for (int lane = 0; lane < LANES; lane++) sum.of[lane] += a.of[lane] * b.of[lane]
#endif

typedef Py_ssize_t Size;

/* Coordinates of a column that are held at zero. */
typedef struct {
    Size column, count;
    const long long *coordinates;
} Hold;

/* What the signature of march() says, below. */
typedef struct {
    Size columns, S, k, n, holds;
    const double *moving, *right, *kicks, *ahead, *onward;
    const double **moved, **whole, **inverses; /* of each step */
    const char *once;
    Hold *hold;
    double *states, *solutions;
    double *left, *more, *held; /* (columns, n) of a step, twice; what solve() needs of k */
} March;

/* y = A x for some rows of A (., m) and some columns x (next_x numbers apart), constants where this is called. */
INLINE void block(const int rows, const int columns, Size m, const double *A, const double *x, Size next_x, double *y,
                  Size next_y)
{
    Lanes sums[4][TOGETHER], row[4], one;
    double of[LANES];
    Size l = 0;
    memset(sums, 0, sizeof(sums));
    for (; l + LANES <= m; l += LANES) {
        UNROLLED
        for (int i = 0; i < rows; i++) {
            memcpy(&row[i], A + i * m + l, sizeof(one));
            PREFETCH(A + (rows + i) * m + l); /* the next rows: matrices of many steps are far away */
        }
        UNROLLED
        for (int j = 0; j < columns; j++) {
            memcpy(&one, x + j * next_x + l, sizeof(one));
            UNROLLED
            for (int i = 0; i < rows; i++) { ADD_PRODUCT(sums[i][j], row[i], one); }
        }
    }
    UNROLLED
    for (int i = 0; i < rows; i++) {
        UNROLLED
        for (int j = 0; j < columns; j++) {
            memcpy(of, &sums[i][j], sizeof(of));
            double sum = (of[0] + of[2]) + (of[1] + of[3]);
            for (Size rest = l; rest < m; rest++) sum += A[i * m + rest] * x[j * next_x + rest];
            y[j * next_y + i] = sum;
        }
    }
}

#define ROWS(rows, columns) \
    for (; i + rows <= n; i += rows) block(rows, columns, m, A + i * m, x, next_x, y + i, next_y)

/* y = A x, A (n, m). */
INLINE void product(Size n, Size m, Size columns, const double *A, const double *x, Size next_x, double *y, Size next_y)
{
    for (; columns > 0; columns -= TOGETHER, x += TOGETHER * next_x, y += TOGETHER * next_y) {
        Size i = 0;
        if (columns >= TOGETHER) {
            ROWS(2, TOGETHER);
            ROWS(1, TOGETHER);
        } else if (columns == 3) {
            ROWS(2, 3);
            ROWS(1, 3);
        } else if (columns == 2) {
            ROWS(4, 2);
            ROWS(1, 2);
        } else {
            ROWS(4, 1);
            ROWS(1, 1);
        }
    }
}

/* Solve A x = b for what replaces b, A (count, count) with b as one more column; whether there is a solution. */
INLINE int solve(Size count, double *A)
{
    const Size row = count + 1;
    for (Size i = 0; i < count; i++) {
        Size largest = i;
        for (Size j = i + 1; j < count; j++)
            if (fabs(A[j * row + i]) > fabs(A[largest * row + i])) largest = j;
        for (Size l = i; largest > i && l < row; l++) {
            const double other = A[i * row + l];
            A[i * row + l] = A[largest * row + l], A[largest * row + l] = other;
        }
        if (A[i * row + i] == 0.0) return 0;
        for (Size j = i + 1; j < count; j++) {
            const double factor = A[j * row + i] / A[i * row + i];
            for (Size l = i + 1; l < row; l++) A[j * row + l] -= factor * A[i * row + l];
        }
    }
    for (Size i = count - 1; i >= 0; i--) {
        double *b = A + i * row + count;
        for (Size j = i + 1; j < count; j++) *b -= A[i * row + j] * A[j * row + count];
        *b /= A[i * row + i];
    }
    return 1;
}

/* Take from solutions z (columns, n) of step i what moves coordinates that are held; whether that is possible. */
INLINE int let_go(const March *all, Size i, double *z)
{
    const Size n = all->n;
    const double *B = all->inverses[i];
    for (const Hold *hold = all->hold; hold < all->hold + all->holds; hold++) {
        const Size count = hold->count, row = count + 1;
        const long long *J = hold->coordinates;
        double *of = z + hold->column * n, *A = all->held;
        for (Size a = 0; a < count; a++) {
            for (Size b = 0; b < count; b++) A[a * row + b] = B[J[a] * n + J[b]];
            A[a * row + count] = of[J[a]];
        }
        if (!solve(count, A)) return 0;
        for (Size l = 0; l < n; l++)
            for (Size b = 0; b < count; b++) of[l] -= B[l * n + J[b]] * A[b * row + count];
        for (Size b = 0; b < count; b++) of[J[b]] = 0.0; /* but for rounding they are */
    }
    return 1;
}

/* Whether all could be held. */
INLINE int march(const March *all)
{
    const Size columns = all->columns, S = all->S, k = all->k, n = all->n;
    const double *last = all->moving;
    for (Size i = 0; i < S; i++) {
        const double *ahead = all->ahead + 12 * i, *onward = all->onward + 16 * i;
        double *now = all->states + i * columns * 4 * k, *z = all->solutions + i * columns * n;
        for (Size j = 0; j < columns; j++) {
            const double *x = last + j * 4 * k, *kick = all->kicks ? all->kicks + (j * S + i) * 2 * k : NULL;
            double *e = now + j * 4 * k; /* what is known of e, e', a, until z is */
            for (Size a = 0; a < 3; a++)
                for (Size l = 0; l < k; l++)
                    e[a * k + l] = ahead[4 * a] * x[l] + ahead[4 * a + 1] * x[k + l] + ahead[4 * a + 2] * x[2 * k + l] +
                                   ahead[4 * a + 3] * x[3 * k + l];
            for (Size l = 0; kick && l < 2 * k; l++) e[l] += kick[l];
        }
        product(n, 2 * k, columns, all->moved[i], now, 4 * k, all->left, n);
        for (Size j = 0; j < columns; j++)
            for (Size l = 0; l < n; l++) all->left[j * n + l] = all->right[(j * S + i) * n + l] - all->left[j * n + l];
        product(n, n, columns, all->inverses[i], all->left, n, z, n);
        if (!let_go(all, i, z)) return 0;
        if (!all->once[i]) {
            product(n, n, columns, all->whole[i], z, n, all->more, n);
            for (Size l = 0; l < columns * n; l++) all->left[l] -= all->more[l];
            product(n, n, columns, all->inverses[i], all->left, n, all->more, n);
            if (!let_go(all, i, all->more)) return 0;
            for (Size l = 0; l < columns * n; l++) z[l] += all->more[l];
        }
        for (Size j = 0; j < columns; j++)
            for (Size l = 0; l < k; l++) {
                double *e = now + j * 4 * k + l;
                const double known[3] = {e[0], e[k], e[2 * k]}, step = z[j * n + l];
                for (Size a = 0; a < 4; a++)
                    e[a * k] = onward[4 * a] * known[0] + onward[4 * a + 1] * known[1] + onward[4 * a + 2] * known[2] +
                               onward[4 * a + 3] * step;
            }
        last = now;
    }
    return 1;
}

static int march_anywhere(const March *all) { return march(all); }
static int (*march_here)(const March *) = march_anywhere;

#ifdef WIDE
WIDE static int march_wide(const March *all) { return march(all); }
#endif

/* Buffers that are held until the march has ended. */
typedef struct {
    Py_buffer *views;
    Size count;
} Held;

/* Numbers of `object`, of so many bytes each, which must be so many; NULL with an error set if they are not. */
static void *numbers(PyObject *object, Held *held, Size count, Size bytes, int flags)
{
    Py_buffer *view = held->views + held->count;
    if (PyObject_GetBuffer(object, view, PyBUF_C_CONTIGUOUS | flags) < 0) return NULL;
    held->count++;
    if (view->itemsize == bytes && view->len == count * bytes) return view->buf;
    PyErr_Format(PyExc_ValueError, "%zd bytes, %zd a number, in place of %zd numbers of %zd", view->len, view->itemsize,
                 count, bytes);
    return NULL;
}

/* Write where the numbers of S matrices begin, which the caller holds; -1 with an error set if they are not there. */
static int matrices(PyObject *object, const double **found, Size S, Size count)
{
    PyObject *all = PySequence_Fast(object, "matrices of steps are a sequence");
    if (all == NULL) return -1;
    if (PySequence_Fast_GET_SIZE(all) != S) PyErr_SetString(PyExc_ValueError, "there is not a matrix of each step");
    for (Size i = 0; i < S && !PyErr_Occurred(); i++) {
        Py_buffer view;
        Held one = {&view, 0};
        found[i] = numbers(PySequence_Fast_GET_ITEM(all, i), &one, count, sizeof(double), 0);
        if (one.count) PyBuffer_Release(&view);
    }
    Py_DECREF(all);
    return PyErr_Occurred() ? -1 : 0;
}

/* Read the arguments, whose memory is given. */
static int prepared(March *all, PyObject *const *given, PyObject *holds, Held *held, const double **rows)
{
    const Size columns = all->columns, S = all->S, k = all->k, n = all->n, size = sizeof(double);
    all->moved = rows, all->whole = rows + S, all->inverses = rows + 2 * S;
    if (!(all->moving = numbers(given[0], held, columns * 4 * k, size, 0)) ||
        !(all->right = numbers(given[1], held, columns * S * n, size, 0)) ||
        (given[2] != Py_None && !(all->kicks = numbers(given[2], held, columns * S * 2 * k, size, 0))) ||
        !(all->ahead = numbers(given[3], held, S * 12, size, 0)) ||
        !(all->onward = numbers(given[4], held, S * 16, size, 0)) || matrices(given[5], all->moved, S, n * 2 * k) < 0 ||
        matrices(given[6], all->whole, S, n * n) < 0 || matrices(given[7], all->inverses, S, n * n) < 0 ||
        !(all->once = numbers(given[8], held, S, 1, 0)) ||
        !(all->states = numbers(given[9], held, S * columns * 4 * k, size, PyBUF_WRITABLE)) ||
        !(all->solutions = numbers(given[10], held, S * columns * n, size, PyBUF_WRITABLE)))
        return -1;
    for (Hold *hold = all->hold; all->holds < PyList_GET_SIZE(holds); hold++, all->holds++) {
        PyObject *coordinates;
        if (!PyArg_ParseTuple(PyList_GET_ITEM(holds, all->holds), "nO", &hold->column, &coordinates)) return -1;
        hold->count = PyObject_Length(coordinates);
        if (hold->count < 0 || !(hold->coordinates = numbers(coordinates, held, hold->count, 8, 0))) return -1;
        for (Size j = 0; j < hold->count; j++)
            if (hold->column < 0 || hold->column >= columns || hold->coordinates[j] < 0 || hold->coordinates[j] >= k || hold->count > k) {
                PyErr_SetString(PyExc_ValueError, "there is no such column or coordinate to hold");
                return -1;
            }
    }
    return 0;
}

#define ARRAYS 11
#define MARCH                                                                                                     \
    "march(columns, S, k, n, moving, right, kicks, ahead, onward, moved, whole, inverses, once, states, solutions, "  \
    "held)\n\nWrite states (S, columns, 4, k) and solutions (S, columns, n) of Steps._marched, which tells the rest; "   \
    "held: list\nof pairs, the number of a column and its coordinates (J,) that are held. Return whether they can be."

static PyObject *marched(PyObject *self, PyObject *arguments)
{
    March all = {0};
    PyObject *given[ARRAYS], *holds, *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnnnOOOOOOOOOOOO!", &all.columns, &all.S, &all.k, &all.n, given, given + 1,
                          given + 2, given + 3, given + 4, given + 5, given + 6, given + 7, given + 8, given + 9,
                          given + 10, &PyList_Type, &holds))
        return NULL;
    Held held = {PyMem_Calloc(ARRAYS + PyList_GET_SIZE(holds), sizeof(Py_buffer)), 0};
    const double **rows = PyMem_Calloc(3 * all.S + 1, sizeof(double *));
    double *work = PyMem_Calloc(2 * all.columns * all.n + all.k * (all.k + 1) + 1, sizeof(double));
    all.hold = PyMem_Calloc(PyList_GET_SIZE(holds) + 1, sizeof(Hold));
    if (!held.views || !rows || !work || !all.hold) {
        PyErr_NoMemory();
    } else if (prepared(&all, given, holds, &held, rows) == 0) {
        all.left = work, all.more = work + all.columns * all.n, all.held = all.more + all.columns * all.n;
        result = PyBool_FromLong(march_here(&all));
    }
    while (held.count) PyBuffer_Release(held.views + --held.count);
    PyMem_Free(held.views), PyMem_Free(rows), PyMem_Free(work), PyMem_Free(all.hold);
    return result;
}

static PyMethodDef methods[] = {{"march", marched, METH_VARARGS, MARCH}, {NULL, NULL, 0, NULL}};
static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "_marched", NULL, -1, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__marched(void)
{
#ifdef WIDE
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) march_here = march_wide;
#endif
    return PyModule_Create(&module);
}
