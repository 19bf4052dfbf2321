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
#include "lanes.h"
#include "norms.h"
#include "curves.h"
#include "oscillators.h"
#include "products.h"
#include "recorder.h"
#include "closed_form.h"
#include "closed_tangent.h"

static void oscillate_anywhere(const Oscillators *all) { oscillate(all); }
static void multiply_anywhere(const Products *all) { multiply(all); }
static void square_anywhere(const Squares *all) { add_all_squares(all); }
static void draw_anywhere(const Curves *all) { draw(all); }
static int measure_anywhere(Lengths *all) { return measure(all); }
static void look_inside_anywhere(const Inside *all) { look_inside(all); }
static double interpolate_anywhere(const Interpolants *all) { return interpolate(all); }
static void find_largest_anywhere(const Sizes *all) { find_largest(all); }
static void (*oscillate_here)(const Oscillators *) = oscillate_anywhere;
static void (*multiply_here)(const Products *) = multiply_anywhere;
static void (*square_here)(const Squares *) = square_anywhere;
static void (*draw_here)(const Curves *) = draw_anywhere;
static int (*measure_here)(Lengths *) = measure_anywhere;
static void (*look_inside_here)(const Inside *) = look_inside_anywhere;
static double (*interpolate_here)(const Interpolants *) = interpolate_anywhere;
static void (*find_largest_here)(const Sizes *) = find_largest_anywhere;

#ifdef WIDE
WIDE static void oscillate_wide(const Oscillators *all) { oscillate(all); }
WIDE static void multiply_wide(const Products *all) { multiply(all); }
WIDE static void square_wide(const Squares *all) { add_all_squares(all); }
WIDE static void draw_wide(const Curves *all) { draw(all); }
WIDE static int measure_wide(Lengths *all) { return measure(all); }
WIDE static void look_inside_wide(const Inside *all) { look_inside(all); }
WIDE static double interpolate_wide(const Interpolants *all) { return interpolate(all); }
WIDE static void find_largest_wide(const Sizes *all) { find_largest(all); }
#endif

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
#include "mechanism_march.h"
#include "mechanism_factors.h"
#include "flow.h"
#include "inverses.h"
#include "mechanism_calls.h"
#include "closed_form_calls.h"

static PyMethodDef methods[] = {{"oscillators", oscillated, METH_VARARGS, OSCILLATORS},
                                {"rows_times", multiplied, METH_VARARGS, PRODUCTS},
                                {"squares", squared, METH_VARARGS, SQUARES},
                                {"curves", curved, METH_VARARGS, CURVES},
                                {"lengths", measured, METH_VARARGS, LENGTHS},
                                {"inside", looked_inside, METH_VARARGS, INSIDE},
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
        oscillate_here = oscillate_wide, multiply_here = multiply_wide,
        square_here = square_wide, draw_here = draw_wide, measure_here = measure_wide,
        look_inside_here = look_inside_wide, interpolate_here = interpolate_wide,
        find_largest_here = find_largest_wide, march_mechanism_here = march_mechanism_wide, flow_here = flow_wide,
        invert_bordered_here = invert_bordered_wide, make_matrices_here = make_matrices_wide, add_here = add_wide, project_here = project_wide;
#endif
    PyObject *made = PyType_Ready(&RecorderType) < 0 ? NULL : PyModule_Create(&module);
    if (made && (PyModule_AddObjectRef(made, "Recorder", (PyObject *)&RecorderType) < 0 ||
                 PyModule_AddIntConstant(made, "VERSION", 11) < 0)) /* as in loops.py */
        Py_CLEAR(made);
    return made;
}
