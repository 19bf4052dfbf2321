/* Errors of steps by series of Faber polynomials: mechanism_errors/flow.py has the equations, and a matrix
exponential in place of the series. */

#include "small_products.h"

#define LOAD_TERMS 4 /* at most, of loads over a step */
#define CONVERGED 1e-9 /* of the largest: a last term above has not converged, for something is out of the ellipse */

typedef struct {
    Size T, n, k, c, m, terms;
    double centre, scale, back;     /* of the ellipse: Series in mechanism_errors/flow.py */
    const double *factors;          /* (terms) */
    const double *h, *A, *B;        /* (T), (T, n, n) twice */
    const double *y, *z;            /* (T, 2 n): begin and end of each step, rates times h */
    const double *loads;            /* (c, T, m, n) */
    const double *C, *C1, *W;       /* (T, k, n) twice, (T, n, k) */
    double *e, *ends, *work;        /* (c, 2 n) goes on from step to step; (T, c, 2 n); flow_work() numbers */
} Flow;

static Size flow_work(const Flow *a) { return ((8 + a->m) * a->n + a->k) * a->c + 2 * a->m; }

/* y = back y + scale (rates of x - centre x): states and rates (n, c) each, and powers of time (m); loads f (m, n c). */
INLINE void go_up(const Flow *a, Size i, Size c, const double *f, double scale, double back, const double *x, double *y)
{
    const Size n = a->n, m = a->m, N = n * c;
    const double h = a->h[i], *w = x + N, *powers = w + N;
    double *of_w = y + N, *of_powers = of_w + N;
    for (Size j = 0; j < 2 * N + m; j++) y[j] = back * y[j] - scale * a->centre * x[j];
    for (Size j = 0; j < N; j++) y[j] += scale * w[j];
    add(n, n, c, scale * h * h, a->A + i * n * n, x, of_w), add(n, n, c, scale * h, a->B + i * n * n, w, of_w);
    for (Size q = 0; q < m; q++) {
        const double by = scale * powers[q];
        for (Size j = 0; j < N; j++) of_w[j] += by * f[q * N + j];
        if (q) of_powers[q] += scale * q * powers[q - 1];
    }
}

/* nan, if one is nan */
INLINE double largest_of(Size count, const double *x)
{
    double most = 0;
    for (Size j = 0; j < count; j++)
        if (most == most && !(fabs(x[j]) <= most)) most = fabs(x[j]);
    return most;
}

/* sums: state and rate, which go on by a step. Whether the series converges. terms: two arrays of 2 N + m numbers. */
INLINE int flow_step(const Flow *a, Size i, Size c, const double *f, double *sums, double *terms)
{
    const Size N = 2 * a->n * c, m = a->m;
    double *now = terms, *next = terms + N + m;
    memcpy(now, sums, N * sizeof(double)), memset(now + N, 0, m * sizeof(double));
    if (m) now[N] = 1;
    memset(next, 0, (N + m) * sizeof(double));
    go_up(a, i, c, f, a->scale, 0, now, next);
    for (Size j = 0; j < N; j++) sums[j] = a->factors[0] * now[j] + a->factors[1] * next[j];
    for (Size q = 2; q < a->terms; q++) {
        go_up(a, i, c, f, a->scale, q == 2 ? 2 * a->back : a->back, next, now);
        for (Size j = 0; j < N; j++) sums[j] += a->factors[q] * now[j];
        double *swap = now;
        now = next, next = swap;
    }
    const double last = fabs(a->factors[a->terms - 1]) * largest_of(N, next);
    return last < HUGE_VAL && last <= CONVERGED * largest_of(N, sums);
}

INLINE Size flow_columns(const Flow *a, Size c)
{
    const Size n = a->n, k = a->k, N = n * c;
    double *x = a->work, *w = x + N, *terms = w + N, *g = terms + 4 * N + 2 * a->m, *f = g + k * c, *e = a->e;
    for (Size i = 0; i < a->T; i++) {
        const double h = a->h[i];
        const Size now = i * 2 * n;
        for (Size j = 0; j < n; j++)
            for (Size o = 0; o < c; o++) {
                x[j * c + o] = a->y[now + j] - e[o * 2 * n + j];
                w[j * c + o] = a->y[now + n + j] - h * e[o * 2 * n + n + j];
                for (Size q = 0; q < a->m; q++)
                    f[(q * n + j) * c + o] = h * h * a->loads[((o * a->T + i) * a->m + q) * n + j];
            }
        if (!flow_step(a, i, c, f, x, terms)) return i;
        for (Size j = 0; j < n; j++)
            for (Size o = 0; o < c; o++) {
                x[j * c + o] = a->z[now + j] - x[j * c + o];
                w[j * c + o] = (a->z[now + n + j] - w[j * c + o]) / h;
            }
        const double *C = a->C + i * k * n, *C1 = a->C1 + i * k * n, *W = a->W + i * n * k;
        memset(g, 0, k * c * sizeof(double)), add(k, n, c, 1, C, x, g), add(n, k, c, -1, W, g, x);
        memset(g, 0, k * c * sizeof(double)), add(k, n, c, 1, C, w, g), add(k, n, c, 1, C1, x, g);
        add(n, k, c, -1, W, g, w);
        for (Size j = 0; j < n; j++)
            for (Size o = 0; o < c; o++) e[o * 2 * n + j] = x[j * c + o], e[o * 2 * n + n + j] = w[j * c + o];
        memcpy(a->ends + i * c * 2 * n, e, c * 2 * n * sizeof(double));
    }
    return a->T;
}

/* How many steps are told: T, or those before one whose series does not converge. */
INLINE Size flow(const Flow *a)
{
    switch (a->c) {
    case 2: return flow_columns(a, 2);
    case 3: return flow_columns(a, 3);
    default: return flow_columns(a, a->c);
    }
}
