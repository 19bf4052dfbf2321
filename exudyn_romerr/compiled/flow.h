/* Errors of steps by power series: mechanism/flow.py has the equations, and a matrix exponential in place of the series. */

#include "small_products.h"

#define LOAD_TERMS 4 /* at most, of loads over a step */
#define ROUNDING 1e-17 /* of the largest: terms below, twice, end a series */

typedef struct {
    Size T, n, k, c, m, pieces, terms;
    const double *h, *A, *B;        /* (T), (T, n, n) twice */
    const double *y, *z;            /* (T, 2 n): begin and end of each step, rates times h */
    const double *loads;            /* (c, T, m, n) */
    const double *C, *C1, *W;       /* (T, k, n) twice, (T, n, k) */
    double *e, *ends, *work;        /* (c, 2 n) goes on from step to step; (T, c, 2 n); flow_work() numbers */
} Flow;

static Size flow_work(const Flow *a) { return ((6 + a->m) * a->n + a->k) * a->c; }

/* Loads over piece p of a step, f (m, N), as powers of that piece's own time. */
INLINE void load_piece(const Flow *a, Size i, Size p, double s, double *f)
{
    static const int over[LOAD_TERMS][LOAD_TERMS] = {{1}, {1, 1}, {1, 2, 1}, {1, 3, 3, 1}};
    const Size n = a->n, c = a->c, m = a->m;
    memset(f, 0, m * n * c * sizeof(double));
    for (Size q = 0; q < m; q++)
        for (Size r = 0; r <= q; r++) {
            double u = s * s * over[q][r];
            for (Size o = 0; o < q - r; o++) u *= (double)p / a->pieces;
            for (Size o = 0; o < r; o++) u /= a->pieces;
            for (Size o = 0; o < c; o++)
                for (Size j = 0; j < n; j++) f[(r * n + j) * c + o] += u * a->loads[((o * a->T + i) * m + q) * n + j];
        }
}

/* x, w: state and rate after a piece of length s. terms: three arrays of N numbers. */
INLINE void flow_piece(const Flow *a, Size i, Size c, double s, const double *f, double *x, double *w, double *terms)
{
    const Size n = a->n, m = a->m, N = n * c;
    double *c0 = terms, *c1 = c0 + N, *c2 = c1 + N;
    memcpy(c0, x, N * sizeof(double)), memcpy(c1, w, N * sizeof(double));
    for (Size j = 0; j < N; j++) x[j] += w[j];
    for (Size q = 0, small = 0; q < a->terms && small < 2; q++) {
        double most = 0, size = 0;
        if (q < m) memcpy(c2, f + q * N, N * sizeof(double));
        else memset(c2, 0, N * sizeof(double));
        add(n, n, c, s * s, a->A + i * n * n, c0, c2), add(n, n, c, (q + 1) * s, a->B + i * n * n, c1, c2);
        for (Size j = 0; j < N; j++) {
            double t = c2[j] / ((q + 2) * (q + 1));
            c2[j] = t, x[j] += t, w[j] += (q + 2) * t;
            t = t < 0 ? -t : t, most = t > most ? t : most;
            t = x[j] < 0 ? -x[j] : x[j], size = t > size ? t : size;
        }
        double *swap = c0;
        c0 = c1, c1 = c2, c2 = swap;
        small = q > m && (q + 2) * most < ROUNDING * size ? small + 1 : 0;
    }
}

INLINE void flow_columns(const Flow *a, Size c)
{
    const Size n = a->n, k = a->k, N = n * c;
    double *x = a->work, *w = x + N, *terms = w + N, *g = terms + 3 * N, *f = g + k * c, *e = a->e;
    for (Size i = 0; i < a->T; i++) {
        const double h = a->h[i];
        const Size now = i * 2 * n;
        for (Size j = 0; j < n; j++)
            for (Size o = 0; o < c; o++) {
                x[j * c + o] = a->y[now + j] - e[o * 2 * n + j];
                w[j * c + o] = (a->y[now + n + j] - h * e[o * 2 * n + n + j]) / a->pieces;
            }
        for (Size p = 0; p < a->pieces; p++) {
            load_piece(a, i, p, h / a->pieces, f);
            flow_piece(a, i, c, h / a->pieces, f, x, w, terms);
        }
        for (Size j = 0; j < n; j++)
            for (Size o = 0; o < c; o++) {
                x[j * c + o] = a->z[now + j] - x[j * c + o];
                w[j * c + o] = (a->z[now + n + j] - w[j * c + o] * a->pieces) / h;
            }
        const double *C = a->C + i * k * n, *C1 = a->C1 + i * k * n, *W = a->W + i * n * k;
        memset(g, 0, k * c * sizeof(double)), add(k, n, c, 1, C, x, g), add(n, k, c, -1, W, g, x);
        memset(g, 0, k * c * sizeof(double)), add(k, n, c, 1, C, w, g), add(k, n, c, 1, C1, x, g);
        add(n, k, c, -1, W, g, w);
        for (Size j = 0; j < n; j++)
            for (Size o = 0; o < c; o++) e[o * 2 * n + j] = x[j * c + o], e[o * 2 * n + n + j] = w[j * c + o];
        memcpy(a->ends + i * c * 2 * n, e, c * 2 * n * sizeof(double));
    }
}

INLINE void flow(const Flow *a)
{
    if (a->c == 2) flow_columns(a, 2);
    else flow_columns(a, a->c);
}
