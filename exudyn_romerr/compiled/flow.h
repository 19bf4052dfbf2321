/* Errors of steps by series of Faber polynomials: mechanism_errors/flow.py has the equations, and a matrix
exponential in place of the series. */

#define LOAD_TERMS 4 /* at most, of loads over a step */
#define CONVERGED 1e-9 /* of the largest: a last term above has not converged, for something is out of the ellipse */

typedef struct {
    Size T, n, k, c, m, terms;
    double centre, scale, back;     /* of the ellipse: Series in mechanism_errors/flow.py */
    const double *factors;          /* (terms) */
    const double *h, *A;            /* (T), (T, n, 2 n): accelerations by states and rates */
    const double *y, *z;            /* (T, 2 n): begin and end of each step, rates times h */
    const double *loads;            /* (c, T, m, n) */
    const double *C, *C1, *W;       /* (T, k, n) twice, (T, n, k) */
    double *e, *ends, *work;        /* (c, 2 n) goes on from step to step; (T, c, 2 n); flow_work() numbers */
} Flow;

static Size flow_work(const Flow *a)
{
    return (8 + a->m) * a->n * a->c + 2 * a->k * a->c + 2 * (a->n * a->n + a->m);
}

/* y = back y + scale (rates of x - centre x): columns (c) of states and rates (2 n), then powers of time (m).

A (n, 2 n) and loads f (c, m, n) by steps of one; g: c n numbers to work in. */
INLINE void go_up(const Flow *a, Size c, const double *A, const double *f, double scale, double back, const double *x,
                  double *y, double *g)
{
    const Size n = a->n, m = a->m, N = 2 * n * c;
    const double *powers = x + N;
    product(n, 2 * n, c, A, x, 2 * n, g, n);
    for (Size o = 0; o < c; o++) {
        const double *RESTRICT s = x + o * 2 * n, *RESTRICT w = s + n;
        double *RESTRICT by = g + o * n, *RESTRICT of_s = y + o * 2 * n, *RESTRICT of_w = of_s + n;
        for (Size q = 0; q < m; q++)
            for (Size j = 0; j < n; j++) by[j] += powers[q] * f[(o * m + q) * n + j];
        for (Size j = 0; j < n; j++) of_s[j] = back * of_s[j] + scale * (w[j] - a->centre * s[j]);
        for (Size j = 0; j < n; j++) of_w[j] = back * of_w[j] + scale * (by[j] - a->centre * w[j]);
    }
    for (Size q = 0; q < m; q++)
        y[N + q] = back * y[N + q] + scale * ((q ? q * powers[q - 1] : 0) - a->centre * powers[q]);
}

/* nan, if one is nan */
INLINE double largest_of(Size count, const double *x)
{
    double most = 0;
    for (Size j = 0; j < count; j++)
        if (most == most && !(fabs(x[j]) <= most)) most = fabs(x[j]);
    return most;
}

/* sums (c, 2 n) go on by a step. Whether the series converges. terms: two arrays of 2 n c + m numbers. */
INLINE int flow_step(const Flow *a, Size c, const double *A, const double *f, double *sums, double *terms, double *g)
{
    const Size N = 2 * a->n * c, m = a->m;
    double *now = terms, *next = terms + N + m;
    memcpy(now, sums, N * sizeof(double)), memset(now + N, 0, m * sizeof(double));
    if (m) now[N] = 1;
    memset(next, 0, (N + m) * sizeof(double));
    go_up(a, c, A, f, a->scale, 0, now, next, g);
    for (Size j = 0; j < N; j++) sums[j] = a->factors[0] * now[j] + a->factors[1] * next[j];
    for (Size q = 2; q < a->terms; q++) {
        go_up(a, c, A, f, a->scale, q == 2 ? 2 * a->back : a->back, next, now, g);
        for (Size j = 0; j < N; j++) sums[j] += a->factors[q] * now[j];
        double *swap = now;
        now = next, next = swap;
    }
    const double last = fabs(a->factors[a->terms - 1]) * largest_of(N, next);
    return last < HUGE_VAL && last <= CONVERGED * largest_of(N, sums);
}

INLINE Size flow_columns(const Flow *a, Size c)
{
    const Size n = a->n, k = a->k, N = 2 * n * c, m = a->m;
    double *x = a->work, *terms = x + N, *A = terms + 2 * (N + m), *f = A + 2 * n * n, *by = f + m * n * c;
    double *out = by + n * c, *g = out + n * c, *of_s = g + k * c, *e = a->e;
    for (Size i = 0; i < a->T; i++) {
        const double h = a->h[i], *y = a->y + i * 2 * n, *z = a->z + i * 2 * n;
        for (Size r = 0; r < n; r++)
            for (Size j = 0; j < n; j++) {
                const Size at = r * 2 * n + j;
                A[at] = h * h * a->A[i * 2 * n * n + at], A[at + n] = h * a->A[i * 2 * n * n + at + n];
            }
        for (Size o = 0; o < c; o++) {
            double *RESTRICT s = x + o * 2 * n;
            for (Size j = 0; j < n; j++) s[j] = y[j] - e[o * 2 * n + j];
            for (Size j = n; j < 2 * n; j++) s[j] = y[j] - h * e[o * 2 * n + j];
            for (Size j = 0; j < m * n; j++) f[o * m * n + j] = h * h * a->loads[(o * a->T + i) * m * n + j];
        }
        if (!flow_step(a, c, A, f, x, terms, by)) return i;
        const double *C = a->C + i * k * n, *C1 = a->C1 + i * k * n, *W = a->W + i * n * k;
        for (Size o = 0; o < c; o++) {
            double *RESTRICT s = x + o * 2 * n, *RESTRICT w = s + n;
            for (Size j = 0; j < n; j++) s[j] = z[j] - s[j], w[j] = (z[n + j] - w[j]) / h;
        }
        product(k, n, c, C, x, 2 * n, g, k), product(n, k, c, W, g, k, out, n);
        for (Size o = 0; o < c; o++)
            for (Size j = 0; j < n; j++) x[o * 2 * n + j] -= out[o * n + j];
        product(k, n, c, C, x + n, 2 * n, g, k), product(k, n, c, C1, x, 2 * n, of_s, k);
        for (Size r = 0; r < k * c; r++) g[r] += of_s[r];
        product(n, k, c, W, g, k, out, n);
        for (Size o = 0; o < c; o++)
            for (Size j = 0; j < n; j++) x[o * 2 * n + n + j] -= out[o * n + j];
        memcpy(e, x, N * sizeof(double)), memcpy(a->ends + i * N, x, N * sizeof(double));
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
