/* The loops of hermite_rows in linalg/bezier.py and of polygon_lengths in linalg/blocked_products.py. */

#define SMALLEST_SQUARE 1e-280 /* as in blocked_products.py */
#define POINTS 6 /* control points of a step */
#define STEPS 8  /* at once: what is made of them on the way stays in the cache */

/* What the text of curves() in loops.c says. */
typedef struct {
    Size S, n, p, straight;
    double alpha, beta;
    const double *h, *q, *q_t, *q_tt, *u, *T;
    double *y;
    double *z, *product, *last; /* (STEPS POINTS, 2 n), (STEPS POINTS, k), and of these the row of a sample */
} Curves;

/* Write z of the control points 1..5 of step s, each (2 n). */
INLINE void merged(const Curves *all, Size s, double *RESTRICT z)
{
    const Size n = all->n;
    const double h = all->h[s], rate_of = 1 / h, alpha = all->alpha, beta = all->beta;
    const double *q = all->q + s * n, *q_t = all->q_t + s * n, *q_tt = all->q_tt + s * n;
    for (Size i = 0; i < n; i++) {
        const double q0 = q[i], q1 = q[n + i], v0 = q_t[i], v1 = q_t[n + i], a0 = q_tt[i], a1 = q_tt[n + i], dq = q1 - q0;
        const double velocity[] = {v0, v0 + h * a0 * 0.25, 5 * dq * rate_of - 2 * (v0 + v1) + h * (a1 - a0) * 0.25, v1 - h * a1 * 0.25, v1};
        const double bend = 20 * dq * rate_of * rate_of, left = bend - (8 * v1 + 12 * v0) * rate_of + a1 - 2 * a0;
        const double right = -bend + (12 * v1 + 8 * v0) * rate_of + a0 - 2 * a1;
        /* of degree 5, as positions are: see _elevation in bezier.py */
        const double acceleration[] = {0.4 * a0 + 0.6 * left, 0.1 * a0 + 0.6 * left + 0.3 * right,
                                       0.3 * left + 0.6 * right + 0.1 * a1, 0.6 * right + 0.4 * a1, a1};
        const double position[] = {q0 + h * v0 * 0.2, q0 + 0.4 * h * v0 + h * h * a0 * 0.05,
                                   q1 - 0.4 * h * v1 + h * h * a1 * 0.05, q1 - h * v1 * 0.2, q1};
        UNROLLED
        for (int j = 1; j < POINTS; j++) {
            const double rate = j < POINTS - 1 ? 0.2 * j * velocity[j - 1] + (1 - 0.2 * j) * velocity[j] : v1;
            z[(j - 1) * 2 * n + i] = acceleration[j - 1] + alpha * rate;
            z[(j - 1) * 2 * n + n + i] = position[j - 1] + beta * rate;
        }
    }
}

/* Write control point j of step s, of z (width), which is what `T` makes of it already. */
INLINE void put(const Curves *all, Size s, Size j, Size width, const double *z)
{
    const Size p = all->p, begin = all->T ? 0 : width, row = begin + p;
    const double share = 0.2 * j, *u = all->u + s * (all->straight ? 1 : POINTS) * p + (all->straight ? 0 : j) * p;
    double *y = all->y + (s * POINTS + j) * row;
    memset(y, 0, row * sizeof(double));
    for (Size i = 0; i < p; i++) y[begin + i] = all->straight ? (1 - share) * u[i] + share * u[p + i] : u[i];
    for (Size i = 0; i < width; i++) y[i] += z[i];
}

INLINE void draw(const Curves *all)
{
    const Size n = all->n, wide = 2 * n, width = all->T ? all->p : wide, inner = POINTS - 1;
    for (Size i = 0; i < n; i++) { /* the first sample; all others are the end of a step */
        all->z[i] = all->q_tt[i] + all->alpha * all->q_t[i];
        all->z[n + i] = all->q[i] + all->beta * all->q_t[i];
    }
    for (Size s = 0; s < all->S; s += STEPS) {
        const Size first = s == 0, steps = all->S - s < STEPS ? all->S - s : STEPS, rows = first + steps * inner;
        for (Size i = 0; i < steps; i++) merged(all, s + i, all->z + (first + i * inner) * wide);
        /* always four together, so that equal rows make equal numbers to the last bit */
        if (all->T)
            product(width, wide, (rows + TOGETHER - 1) / TOGETHER * TOGETHER, all->T, all->z, wide, all->product, width);
        const double *z = all->T ? all->product : all->z;
        if (first) memcpy(all->last, z, width * sizeof(double)), z += width;
        for (Size i = 0; i < steps; i++, z += inner * width) {
            put(all, s + i, 0, width, all->last);
            for (Size j = 1; j < POINTS; j++) put(all, s + i, j, width, z + (j - 1) * width);
            memcpy(all->last, z + (inner - 1) * width, width * sizeof(double));
        }
    }
}

/* What the text of lengths() in loops.c says. */
typedef struct {
    Size S, d, k, first;
    const double *c;
    double *y;
    Squares squares; /* of STEPS d rows, without columns: of the rows themselves */
    double *rows;    /* of what is left of differences from `first` on */
} Lengths;

INLINE double square_of(Size k, const double *x)
{
    Lanes sum, one;
    double of[LANES];
    Size l = 0;
    memset(&sum, 0, sizeof(sum));
    for (; l + LANES <= k; l += LANES) {
        memcpy(&one, x + l, sizeof(one));
        ADD_PRODUCT(sum, one, one);
    }
    memcpy(of, &sum, sizeof(of));
    double square = (of[0] + of[2]) + (of[1] + of[3]);
    for (; l < k; l++) square += x[l] * x[l];
    return square;
}

/* Whether no square lost digits or overflowed. */
INLINE int measure(Lengths *all)
{
    const Size d = all->d, k = all->k, left = k - all->first;
    double *square = all->squares.y;
    for (Size s = 0; s < all->S; s += STEPS) {
        const Size steps = all->S - s < STEPS ? all->S - s : STEPS;
        for (Size i = 0; i < steps; i++)
            for (Size j = 0; j < d; j++) {
                const double *c = all->c + ((s + i) * (d + 1) + j) * k + all->first;
                double *x = all->rows + (i * d + j) * left;
                for (Size l = 0; l < left; l++) x[l] = c[k + l] - c[l];
            }
        all->squares.S = steps * d;
        if (all->squares.columns) add_all_squares(&all->squares);
        for (Size j = 0; !all->squares.columns && j < steps * d; j++) square[j] = square_of(left, all->rows + j * left);
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
