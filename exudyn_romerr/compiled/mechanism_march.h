/* Steps of a linearised mechanism under many right-hand sides: mechanism/march.py has the equations, and them in NumPy.
Matrices row by row; columns of right-hand sides stand side by side: x[n][columns]. */

#include "small_products.h"

typedef struct {
    Size first, s, wave, m;                  /* unknowns, oscillators: where they begin, how many */
    const double *M, *D, *K, *D_back, *K_back; /* (T, s, m) */
    const double *up, *down, *soft;          /* (T, s, m), (T, s, m), (T, m) */
    const double *springs, *dampers;         /* (m) */
} Oscillating;

typedef struct { double p[4], J[12], H[12], H1[12], H2[12], B1[9], B2[9]; } Turn;

typedef struct {
    Size T, n, n_a, k, c, orders, first_order, nodes, bodies; /* first_order: the last of n_a, rates by the trapezoidal rule */
    const int64_t *spin; /* (nodes): where their rotations are */
    const Oscillating *body;
    const double *scheme, *h, *c1, *c2, *M, *D, *K, *C, *inverse, *sampled, *f, *g; /* sampled: (orders, T, n_a, n_a) */
    const Turn *turns;                /* (T, nodes) */
    double *x, *y, *e, *l, *work; /* states (4, n, c), (4, nodes, 4, c); (T, 3, n, c), (T, k, c); march_work() numbers */
} Mechanism;

static Size march_work(const Mechanism *a) { return (4 * a->n + a->k + 15 * a->nodes) * a->c; }

/* q, v: state x (4, N) after h without new accelerations; the scheme's own become what it carries on */
INLINE void predict(Size N, double h, const double *scheme, double *RESTRICT x, double *RESTRICT q, double *RESTRICT v)
{
    const double am = scheme[0], af = scheme[1], be = scheme[2], ga = scheme[3];
    for (Size j = 0; j < N; j++) {
        const double own = x[3 * N + j], carried = (af * x[2 * N + j] - am * own) / (1 - am);
        q[j] = x[j] + h * x[N + j] + h * h * ((0.5 - be) * own + be * carried);
        v[j] = x[N + j] + h * ((1 - ga) * own + ga * carried);
        x[3 * N + j] = carried;
    }
}

/* What Euler parameters predict of rotations b: into q, v, and a0 of their accelerations; nu keeps them of length one. */
INLINE void predict_turn(const Turn *t, Size c, double c2, const double *P, const double *P1, double *nu, double *q,
                         double *v, double *a0)
{
    memset(q, 0, 3 * c * sizeof(double)), memset(v, 0, 3 * c * sizeof(double)), memset(a0, 0, 3 * c * sizeof(double));
    add(3, 4, c, 1, t->H, P, q), add(3, 4, c, 1, t->H, P1, v);
    for (Size o = 0; o < c; o++) {
        double along = 0;
        for (Size j = 0; j < 4; j++) along += t->p[j] * P[j * c + o];
        for (Size j = 0; j < 4; j++) nu[j * c + o] = -t->p[j] * along;
    }
    add(3, 4, c, 1, t->H1, P, v), add(3, 4, c, 1, t->H1, nu, v);
    add(3, 4, c, 2, t->H1, P1, a0), add(3, 4, c, 2 * c2, t->H1, nu, a0);
    add(3, 4, c, 1, t->H2, P, a0), add(3, 4, c, 1, t->H2, nu, a0);
}

/* Right-hand side of a body's oscillators, into its place in z; what they add to that of its unknowns. */
INLINE void push(const Mechanism *a, const Oscillating *B, Size b, Size i, Size c, const double *q, const double *v,
                 const double *a0, double *r, double *z)
{
    const Size s = B->s, m = B->m, at = i * s * m;
    const double *qa = q + B->first * c, *va = v + B->first * c, *qp = q + B->wave * c, *vp = v + B->wave * c;
    const double *F = a->f + (i * a->n + B->wave) * c;
    double *ra = r + B->first * c, *W = z + B->wave * c;
    for (Size j = 0; j < m; j++)
        for (Size o = 0; o < c; o++)
            W[j * c + o] = F[j * c + o] - B->springs[j] * qp[j * c + o] - B->dampers[j] * vp[j * c + o];
    add_transposed(s, m, c, -1, B->K_back + at, qa, W), add_transposed(s, m, c, -1, B->D_back + at, va, W);
    add_transposed(3, m, c, -1, B->M + at + 3 * m, a0 + 3 * b * c, W);
    add(s, m, c, -1, B->K + at, qp, ra), add(s, m, c, -1, B->D + at, vp, ra), add(s, m, c, -1, B->up + at, W, ra);
}

INLINE void march_columns(const Mechanism *a, Size c)
{
    const double share = (1 - a->scheme[1]) / (1 - a->scheme[0]);
    const Size n = a->n, n_a = a->n_a, k = a->k, N = n * c, na = n_a * c, w = n_a + k, E = 4 * a->nodes * c;
    const Size of_first = na - a->first_order * c;
    double *x = a->x, *y = a->y, *q = a->work, *v = q + N, *r = v + N, *z = r + na + k * c, *P = z + N, *P1 = P + E;
    double *nu = P1 + E, *a0 = nu + E;
    for (Size i = 0; i < a->T; i++) {
        const Turn *turn = a->turns + i * a->nodes;
        const double c1 = a->c1[i], c2 = a->c2[i], *M = a->M + i * n_a * n_a;
        memcpy(r, a->f + i * N, na * sizeof(double)), memcpy(r + na, a->g + i * k * c, k * c * sizeof(double));
        for (Size o = 0; o < a->orders; o++) /* by the row before */
            add(n_a, n_a, c, -1, a->sampled + (o * a->T + i) * n_a * n_a, x + o * N, r);
        predict(N, a->h[i], a->scheme, x, q, v), predict(E, a->h[i], a->scheme, y, P, P1);
        for (Size j = of_first; j < na; j++) v[j] = x[N + j] + a->h[i] / 2 * x[2 * N + j];
        for (Size b = 0; b < a->nodes; b++) {
            const Size at = a->spin[b];
            predict_turn(turn + b, c, c2, P + 4 * b * c, P1 + 4 * b * c, nu + 4 * b * c, q + at * c, v + at * c,
                         a0 + 3 * b * c);
            for (Size j = 0; j < n_a; j++) add(1, 3, c, -1, M + j * n_a + at, a0 + 3 * b * c, r + j * c);
        }
        add(n_a, n_a, c, -1, a->K + i * n_a * n_a, q, r), add(n_a, n_a, c, -1, a->D + i * n_a * n_a, v, r);
        add(k, n_a, c, -1, a->C + i * k * n_a, q, r + na);
        for (Size b = 0; b < a->bodies; b++) push(a, a->body + b, b, i, c, q, v, a0, r, z);
        memset(z, 0, na * sizeof(double)), memset(a->l + i * k * c, 0, k * c * sizeof(double));
        add(n_a, w, c, 1, a->inverse + i * w * w, r, z);
        add(k, w, c, 1, a->inverse + i * w * w + n_a * w, r, a->l + i * k * c);
        for (Size b = 0; b < a->bodies; b++) {
            const Oscillating *B = a->body + b;
            double *W = z + B->wave * c;
            add_transposed(B->s, B->m, c, -1, B->down + i * B->s * B->m, z + B->first * c, W);
            for (Size j = 0; j < B->m; j++)
                for (Size o = 0; o < c; o++) W[j * c + o] *= B->soft[i * B->m + j];
        }
        for (Size j = 0; j < N; j++) x[j] = q[j] + z[j], x[N + j] = v[j] + c2 * z[j], x[2 * N + j] = c1 * z[j];
        for (Size j = of_first; j < na; j++) x[2 * N + j] = 2 * c2 / a->h[i] * z[j];
        for (Size b = 0; b < a->nodes; b++) {
            const double *zb = z + a->spin[b] * c;
            double *ab = x + 2 * N + a->spin[b] * c;
            add(3, 3, c, 1, turn[b].B1, zb, x + N + a->spin[b] * c), add(3, 3, c, 1, turn[b].B2, zb, ab);
            for (Size j = 0; j < 3 * c; j++) ab[j] += a0[3 * b * c + j];
            add(4, 3, c, 1, turn[b].J, zb, nu + 4 * b * c); /* the increment of Euler parameters */
        }
        for (Size j = 0; j < N; j++) x[3 * N + j] += share * x[2 * N + j];
        for (Size j = 0; j < E; j++) {
            y[j] = P[j] + nu[j], y[E + j] = P1[j] + c2 * nu[j], y[2 * E + j] = c1 * nu[j];
            y[3 * E + j] += share * y[2 * E + j];
        }
        memcpy(a->e + i * 3 * N, x, 3 * N * sizeof(double));
    }
}

/* Numbers of columns that compilers unroll: those of corrections, of parts without and with rigid interfaces. */
INLINE void march_mechanism(const Mechanism *a)
{
    switch (a->c) {
    case 1: march_columns(a, 1); break;
    case 2: march_columns(a, 2); break;
    case 3: march_columns(a, 3); break;
    default: march_columns(a, a->c);
    }
}
