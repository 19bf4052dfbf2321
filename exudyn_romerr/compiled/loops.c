/* Loops that take long in Python. NumPy has them all, sums products in another order, and is what tests compare with.

Arrays come as buffers, so that building this needs nothing but Python. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <structmember.h>

#ifdef __GNUC__ /* Clang, too */
#define INLINE static inline __attribute__((always_inline))
#define UNROLLED _Pragma("GCC unroll 8")
#define PREFETCH(place) __builtin_prefetch(place)
#define RESTRICT __restrict__
#ifdef __x86_64__
#define WIDE __attribute__((target("avx2,fma")))
#endif
#else
#define INLINE static __forceinline
#define UNROLLED
#define PREFETCH(place)
#define RESTRICT __restrict
#endif

typedef Py_ssize_t Size;

#include "buffers.h"
#include "march.h"
#include "norms.h"
#include "curves.h"
#include "oscillators.h"
#include "products.h"
#include "recorder.h"
#include "closed_form.h"
#include "closed_tangent.h"

static int march_anywhere(March *all) { return march(all); }
static void oscillate_anywhere(const Oscillators *all) { oscillate(all); }
static void multiply_anywhere(const Products *all) { multiply(all); }
static void square_anywhere(const Squares *all) { add_all_squares(all); }
static void draw_anywhere(const Curves *all) { draw(all); }
static int measure_anywhere(Lengths *all) { return measure(all); }
static void look_inside_anywhere(const Inside *all) { look_inside(all); }
static double interpolate_anywhere(const Interpolants *all) { return interpolate(all); }
static void find_largest_anywhere(const Sizes *all) { find_largest(all); }
static int (*march_here)(March *) = march_anywhere;
static void (*oscillate_here)(const Oscillators *) = oscillate_anywhere;
static void (*multiply_here)(const Products *) = multiply_anywhere;
static void (*square_here)(const Squares *) = square_anywhere;
static void (*draw_here)(const Curves *) = draw_anywhere;
static int (*measure_here)(Lengths *) = measure_anywhere;
static void (*look_inside_here)(const Inside *) = look_inside_anywhere;
static double (*interpolate_here)(const Interpolants *) = interpolate_anywhere;
static void (*find_largest_here)(const Sizes *) = find_largest_anywhere;

#ifdef WIDE
WIDE static int march_wide(March *all) { return march(all); }
WIDE static void oscillate_wide(const Oscillators *all) { oscillate(all); }
WIDE static void multiply_wide(const Products *all) { multiply(all); }
WIDE static void square_wide(const Squares *all) { add_all_squares(all); }
WIDE static void draw_wide(const Curves *all) { draw(all); }
WIDE static int measure_wide(Lengths *all) { return measure(all); }
WIDE static void look_inside_wide(const Inside *all) { look_inside(all); }
WIDE static double interpolate_wide(const Interpolants *all) { return interpolate(all); }
WIDE static void find_largest_wide(const Sizes *all) { find_largest(all); }
#endif

/* Read the arguments, whose memory is given. */
static int prepared(March *all, PyObject *const *given, PyObject *holds, Held *held)
{
    const Size columns = all->columns, S = all->S, k = all->k, n = all->n;
    if (!(all->moving = numbers(given[0], held, columns * 4 * k, 'd', 0)) ||
        !(all->right = numbers(given[1], held, columns * S * n, 'd', 0)) ||
        (given[2] != Py_None && !(all->kicks = numbers(given[2], held, columns * S * 2 * k, 'd', 0))) ||
        !(all->ahead = numbers(given[3], held, S * 12, 'd', 0)) ||
        !(all->onward = numbers(given[4], held, S * 16, 'd', 0)) ||
        !(all->moved = numbers(given[5], held, S * n * 2 * k, 'd', 0)) ||
        !(all->whole = numbers(given[6], held, S * n * n, 'd', 0)) ||
        !(all->inverses = numbers(given[7], held, S * n * n, 'd', 0)) ||
        !(all->once = numbers(given[8], held, S, '?', 0)) ||
        !(all->states = numbers(given[9], held, S * columns * 4 * k, 'd', PyBUF_WRITABLE)) ||
        !(all->multipliers = numbers(given[10], held, S * columns * (n - k), 'd', PyBUF_WRITABLE)))
        return -1;
    for (Hold *hold = all->hold; all->holds < PyList_GET_SIZE(holds); hold++, all->holds++) {
        PyObject *coordinates;
        if (!PyArg_ParseTuple(PyList_GET_ITEM(holds, all->holds), "nO", &hold->column, &coordinates)) return -1;
        hold->count = PyObject_Length(coordinates);
        if (hold->count < 0 || !(hold->coordinates = numbers(coordinates, held, hold->count, 'q', 0))) return -1;
        int is_none = hold->column < 0 || hold->column >= columns || hold->count > k;
        for (Size j = 0; j < hold->count; j++) is_none |= hold->coordinates[j] < 0 || hold->coordinates[j] >= k;
        if (is_none) {
            PyErr_SetString(PyExc_ValueError, "there is no such column or coordinate to hold");
            return -1;
        }
    }
    return 0;
}

#define ARRAYS 11
#define MARCH                                                                                                        \
    "march(columns, S, k, n, moving, right, kicks, ahead, onward, moved, whole, inverses, once, states, multipliers, " \
    "held)\n\nWrite states (S, columns, 4, k) and multipliers (S, columns, n - k) of Steps.march, which tells the "     \
    "rest; held:\nlist of pairs, the number of a column and its coordinates (J,) that are held. Return whether they "    \
    "can be."

static PyObject *marched(PyObject *self, PyObject *arguments)
{
    March all = {0};
    PyObject *given[ARRAYS], *holds, *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnnnOOOOOOOOOOOO!", &all.columns, &all.S, &all.k, &all.n, given, given + 1,
                          given + 2, given + 3, given + 4, given + 5, given + 6, given + 7, given + 8, given + 9,
                          given + 10, &PyList_Type, &holds))
        return NULL;
    if (!are_sizes(5, all.columns, all.S, all.k, all.n, all.n) || !are_sizes(1, all.n - all.k)) return NULL;
    const Size of_all = all.columns * all.n;
    Held held = {PyMem_Calloc(ARRAYS + PyList_GET_SIZE(holds), sizeof(Py_buffer)), 0};
    double *work = PyMem_Calloc(3 * of_all + all.columns * 4 * all.k + all.k * (all.k + 1) + 1, sizeof(double));
    Size *numbers_of = PyMem_Calloc(2 * all.columns + 1, sizeof(Size));
    all.hold = PyMem_Calloc(PyList_GET_SIZE(holds) + 1, sizeof(Hold));
    if (!held.views || !work || !numbers_of || !all.hold) {
        PyErr_NoMemory();
    } else if (prepared(&all, given, holds, &held) == 0) {
        all.from = numbers_of, all.place = numbers_of + all.columns;
        all.z = work, all.left = work + of_all, all.more = work + 2 * of_all, all.now = work + 3 * of_all;
        all.held = all.now + all.columns * 4 * all.k;
        result = PyBool_FromLong(march_here(&all));
    }
    release(&held);
    PyMem_Free(work), PyMem_Free(numbers_of), PyMem_Free(all.hold), PyMem_Free(held.views);
    return result;
}

#define OSCILLATORS                                                                                                  \
    "oscillators(S, points, m, state, A, weights, F, y)\n\nWrite y (S, 2, m) = A (2, 2, m) y_before + weights (2, "   \
    "points, m) F (S, points, m), from state (2, m) on."

static PyObject *oscillated(PyObject *self, PyObject *arguments)
{
    Oscillators all = {0};
    PyObject *given[5], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnnOOOOO", &all.S, &all.points, &all.m, given, given + 1, given + 2, given + 3,
                          given + 4) ||
        !are_sizes(3, all.S, all.points, all.m))
        return NULL;
    Py_buffer views[5];
    Held held = {views, 0};
    const Size m = all.m;
    if ((all.state = numbers(given[0], &held, 2 * m, 'd', 0)) && (all.A = numbers(given[1], &held, 4 * m, 'd', 0)) &&
        (all.weights = numbers(given[2], &held, 2 * all.points * m, 'd', 0)) &&
        (all.F = numbers(given[3], &held, all.S * all.points * m, 'd', 0)) &&
        (all.y = numbers(given[4], &held, all.S * 2 * m, 'd', PyBUF_WRITABLE))) {
        oscillate_here(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    return result;
}

#define SQUARES                                                                                                   \
    "squares(S, k, m, rows, columns, y)\n\nWrite y (S,), sums of the squares of products of rows (S, k) with columns (m, " \
    "k) of a\nmatrix, one behind the other."

static PyObject *squared(PyObject *self, PyObject *arguments)
{
    Squares all = {0};
    Size m;
    const double *columns;
    PyObject *given[3], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnnOOO", &all.S, &all.k, &m, given, given + 1, given + 2) ||
        !are_sizes(3, all.S, all.k, m))
        return NULL;
    Py_buffer views[3];
    Held held = {views, 0};
    const Size size = sizeof(double);
    all.blocks = (m + WIDTH * LANES - 1) / (WIDTH * LANES);
    all.columns = PyMem_Calloc(all.blocks * all.k * WIDTH * LANES + 1, size);
    all.begins = PyMem_Calloc(all.blocks + 1, sizeof(Size));
    if (!all.columns || !all.begins) {
        PyErr_NoMemory();
    } else if ((all.rows = numbers(given[0], &held, all.S * all.k, 'd', 0)) &&
               (columns = numbers(given[1], &held, m * all.k, 'd', 0)) &&
               (all.y = numbers(given[2], &held, all.S, 'd', PyBUF_WRITABLE))) {
        arrange(&all, m, columns);
        square_here(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    PyMem_Free(all.columns), PyMem_Free(all.begins);
    return result;
}

#include "product_calls.h"
#include "curve_calls.h"
#include "inertia.h"
#include "mechanism_march.h"
#include "mechanism_factors.h"
#include "flow.h"
#include "inverses.h"
#include "mechanism_calls.h"
#include "closed_form_calls.h"

static PyMethodDef methods[] = {{"march", marched, METH_VARARGS, MARCH},
                                {"oscillators", oscillated, METH_VARARGS, OSCILLATORS},
                                {"rows_times", multiplied, METH_VARARGS, PRODUCTS},
                                {"squares", squared, METH_VARARGS, SQUARES},
                                {"curves", curved, METH_VARARGS, CURVES},
                                {"lengths", measured, METH_VARARGS, LENGTHS},
                                {"inside", looked_inside, METH_VARARGS, INSIDE},
                                {"inertia", weighed, METH_VARARGS, INERTIA},
                                {"interpolate", interpolated, METH_VARARGS, INTERPOLATE},
                                {"largest_sizes", sized, METH_VARARGS, LARGEST_SIZES},
                                {"decaying_sums", summed_up, METH_VARARGS, SUMS},
                                {"march_mechanism", mechanism_marched, METH_VARARGS, MECHANISM},
                                {"flow", flowed, METH_VARARGS, FLOW},
                                {"step_matrices", matrices_made, METH_VARARGS, MATRICES},
                                {"turn_frames", frames_turned, METH_VARARGS, TURNED},
                                {"bordered_inverses", bordered_inverted, METH_VARARGS, BORDERED},
                                {"moved_motion", moved_motion, METH_VARARGS, MOVED},
                                {"body_residual", found_residual, METH_VARARGS, RESIDUAL},
                                {"body_tangent", found_tangent, METH_VARARGS, TANGENT},
                                {NULL, NULL, 0, NULL}};
static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "_loops", NULL, -1, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__loops(void)
{
#ifdef WIDE
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        march_here = march_wide, oscillate_here = oscillate_wide, multiply_here = multiply_wide,
        square_here = square_wide, draw_here = draw_wide, measure_here = measure_wide,
        look_inside_here = look_inside_wide, weigh_here = weigh_wide, interpolate_here = interpolate_wide,
        find_largest_here = find_largest_wide, march_mechanism_here = march_mechanism_wide, flow_here = flow_wide,
        invert_bordered_here = invert_bordered_wide, make_matrices_here = make_matrices_wide, add_here = add_wide, project_here = project_wide;
#endif
    PyObject *made = PyType_Ready(&RecorderType) < 0 ? NULL : PyModule_Create(&module);
    if (made && (PyModule_AddObjectRef(made, "Recorder", (PyObject *)&RecorderType) < 0 ||
                 PyModule_AddIntConstant(made, "VERSION", 10) < 0)) /* as in loops.py */
        Py_CLEAR(made);
    return made;
}
