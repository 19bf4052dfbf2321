/* Arrays of arguments: their memory, or an error where they are not what they are said to be. */

#include <stdarg.h>

#define LARGEST 72057594037927936.0 /* 2^56: bytes of no array of these sizes overflow */

/* Buffers that are held until the loop has ended. */
typedef struct {
    Py_buffer *views;
    Size count;
} Held;

/* Whether a buffer is of numbers of a kind of struct: 'd', '?', or 'q', whatever this machine calls 8 bytes. */
static int are_of(const Py_buffer *view, char kind)
{
    const char *format = view->format ? view->format : "B";
    return format[0] != '\0' && format[1] == '\0' && (format[0] == kind || (kind == 'q' && format[0] == 'l'));
}

/* Numbers of `object`, of a kind, which must be so many; NULL with an error set if they are not. */
static void *numbers(PyObject *object, Held *held, Size count, char kind, int flags)
{
    const Size bytes = kind == '?' ? 1 : 8;
    Py_buffer *view = held->views + held->count;
    if (PyObject_GetBuffer(object, view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | flags) < 0) return NULL;
    held->count++;
    if (are_of(view, kind) && view->itemsize == bytes && view->len == count * bytes) return view->buf;
    PyErr_Format(PyExc_ValueError, "%zd bytes, numbers of kind %s, in place of %zd numbers of kind %c", view->len,
                 view->format ? view->format : "B", count, kind);
    return NULL;
}

static void release(Held *held)
{
    while (held->count) PyBuffer_Release(held->views + --held->count);
}

/* Whether sizes of arrays are none below 0, and none of their products overflows; an error is set if not. */
static int are_sizes(int count, ...)
{
    double product = 1.0;
    int is_negative = 0;
    va_list sizes;
    va_start(sizes, count);
    while (count--) {
        const Size size = va_arg(sizes, Size);
        is_negative |= size < 0;
        product *= size > 1 ? (double)size : 1.0;
    }
    va_end(sizes);
    if (!is_negative && product < LARGEST) return 1;
    PyErr_SetString(PyExc_ValueError, is_negative ? "sizes are negative" : "sizes are too large");
    return 0;
}
