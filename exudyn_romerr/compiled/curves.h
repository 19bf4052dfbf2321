/* The loops of hermite_rows and interpolated in linalg/bezier.py, of polygon_lengths in linalg/blocked_products.py. */

#define SMALLEST_SQUARE 1e-280 /* as in blocked_products.py */
#define POINTS 6 /* control points of a step */
#define STEPS 8  /* at once: what is made of them on the way stays in the cache */

/* What the text of curves() in loops.c says. */
typedef struct {
    Size S, n, p;
    double alpha, beta;
    const double *h, *q, *q_t, *q_tt, *u, *controls, *ends;
    double *y;
    double *z; /* of the inner control points of a step: (4, 2 n) */
} Curves;

/* Write z of the inner control points of step s. */
INLINE void merged(const Curves *all, Size s)
{
    const Size n = all->n;
    const double h = all->h[s], per_h = 1 / h, alpha = all->alpha, beta = all->beta;
    const double *q = all->q + s * n, *q_t = all->q_t + s * n, *q_tt = all->q_tt + s * n;
    double *RESTRICT z = all->z;
    for (Size i = 0; i < n; i++) {
        const double q0 = q[i], q1 = q[n + i], v0 = q_t[i], v1 = q_t[n + i], a0 = q_tt[i], a1 = q_tt[n + i], dq = q1 - q0;
        const double velocity[] = {v0, v0 + 0.25 * h * a0, 5 * dq * per_h - 2 * (v0 + v1) + 0.25 * h * (a1 - a0),
                                   v1 - 0.25 * h * a1, v1};
        const double bend = 20 * dq * per_h * per_h, left = bend - (8 * v1 + 12 * v0) * per_h + a1 - 2 * a0;
        const double right = -bend + (12 * v1 + 8 * v0) * per_h + a0 - 2 * a1;
        /* of degree 5, as positions are: see _elevation in bezier.py */
        const double acceleration[] = {0.4 * a0 + 0.6 * left, 0.1 * a0 + 0.6 * left + 0.3 * right,
                                       0.3 * left + 0.6 * right + 0.1 * a1, 0.6 * right + 0.4 * a1};
        const double position[] = {q0 + 0.2 * h * v0, q0 + 0.4 * h * v0 + 0.05 * h * h * a0,
                                   q1 - 0.4 * h * v1 + 0.05 * h * h * a1, q1 - 0.2 * h * v1};
        UNROLLED
        for (int j = 0; j < POINTS - 2; j++) {
            const double share = 0.2 * (j + 1), rate = share * velocity[j] + (1 - share) * velocity[j + 1];
            z[j * 2 * n + i] = acceleration[j] + alpha * rate;
            z[j * 2 * n + n + i] = position[j] + beta * rate;
        }
    }
}

INLINE void draw(const Curves *all)
{
    const Size p = all->p, wide = 2 * all->n, row = wide + p;
    for (Size s = 0; s < all->S; s++) {
        double *y = all->y + s * POINTS * row;
        merged(all, s);
        memcpy(y, all->ends + s * row, row * sizeof(double));
        for (Size j = 1; j < POINTS - 1; j++) {
            const double share = 0.2 * j, *u = all->u + s * p, *control = all->controls + (s * POINTS + j) * p;
            y += row;
            memcpy(y, all->z + (j - 1) * wide, wide * sizeof(double));
            for (Size i = 0; i < p; i++) y[wide + i] = all->controls ? control[i] : (1 - share) * u[i] + share * u[p + i];
        }
        memcpy(y + row, all->ends + (s + 1) * row, row * sizeof(double));
    }
}

/* What the text of lengths() in loops.c says. */
typedef struct {
    Size S, d, k;
    const double *c;
    double *y;
    Squares squares; /* of STEPS d rows */
    double *rows;    /* differences */
} Lengths;

/* Whether no square lost digits or overflowed. */
INLINE int measure(Lengths *all)
{
    const Size d = all->d, k = all->k;
    const double *square = all->squares.y;
    for (Size s = 0; s < all->S; s += STEPS) {
        const Size steps = all->S - s < STEPS ? all->S - s : STEPS;
        for (Size i = 0; i < steps; i++)
            for (Size j = 0; j < d; j++) {
                const double *c = all->c + ((s + i) * (d + 1) + j) * k;
                double *x = all->rows + (i * d + j) * k;
                for (Size l = 0; l < k; l++) x[l] = c[k + l] - c[l];
            }
        all->squares.S = steps * d;
        add_all_squares(&all->squares);
        for (Size i = 0; i < steps; i++) {
            double sum = 0.0;
            for (Size j = i * d; j < (i + 1) * d; j++) {
                if (!(square[j] > SMALLEST_SQUARE && square[j] < HUGE_VAL)) return 0;
                sum += sqrt(square[j]);
            }
            all->y[s + i] = sum;
        }
    }
    return 1;
}

#define INNER (POINTS - 2) /* nodes of an interpolant within a step */
#define CHECKED (POINTS - 1) /* where what it misses is looked at */

/* What the text of interpolate() in loops.c says. */
typedef struct {
    Size S, p;
    const double *first, *last, *values, *from_nodes, *at_checks;
    double *controls, *largest, *summed;
} Interpolants;

/* Return the largest size of any value at a node. */
INLINE double interpolate(const Interpolants *all)
{
    const Size p = all->p;
    double from[POINTS][POINTS], at[POINTS][CHECKED], size = 0.0; /* both turned: sums of columns */
    for (int i = 0; i < POINTS; i++)
        for (int j = 0; j < POINTS; j++) from[j][i] = all->from_nodes[i * POINTS + j];
    for (int i = 0; i < CHECKED; i++)
        for (int j = 0; j < POINTS; j++) at[j][i] = all->at_checks[i * POINTS + j];
    for (Size s = 0; s < all->S; s++)
        for (Size l = 0; l < p; l++) {
            const double *values = all->values + s * (INNER + CHECKED) * p + l;
            double *controls = all->controls + s * POINTS * p + l, most = 0.0, sum = 0.0;
            double nodes[POINTS], control[POINTS] = {0}, missed[CHECKED];
            nodes[0] = all->first[s * p + l], nodes[POINTS - 1] = all->last[s * p + l];
            UNROLLED
            for (int j = 0; j < INNER; j++) nodes[1 + j] = values[(2 * j + 1) * p];
            for (int j = 0; j < POINTS; j++) {
                size = fabs(nodes[j]) > size ? fabs(nodes[j]) : size;
                UNROLLED
                for (int i = 0; i < POINTS; i++) control[i] += from[j][i] * nodes[j];
            }
            control[0] = nodes[0], control[POINTS - 1] = nodes[POINTS - 1];
            UNROLLED
            for (int i = 0; i < CHECKED; i++) missed[i] = values[2 * i * p];
            for (int j = 0; j < POINTS; j++) {
                controls[j * p] = control[j];
                UNROLLED
                for (int i = 0; i < CHECKED; i++) missed[i] -= at[j][i] * control[j];
            }
            for (int i = 0; i < CHECKED; i++) {
                const double miss = fabs(missed[i]);
                most = miss <= most ? most : miss; /* nan stays in the sum */
                sum += miss;
            }
            all->largest[s * p + l] = most, all->summed[s * p + l] = sum;
        }
    return size;
}
