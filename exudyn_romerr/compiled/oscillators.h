/* The loop of ModalOscillators in linalg/modal_oscillators.py, for segments of one length. */

/* What the text of oscillators() in loops.c says. */
typedef struct {
    Size S, points, m;
    const double *state, *A, *weights, *F;
    double *y;
} Oscillators;

INLINE void oscillate(const Oscillators *all)
{
    const Size m = all->m;
    const double *A = all->A, *before = all->state;
    for (Size s = 0; s < all->S; s++) {
        double *RESTRICT y = all->y + s * 2 * m;
        for (Size i = 0; i < m; i++) y[i] = A[i] * before[i] + A[m + i] * before[m + i];
        for (Size i = 0; i < m; i++) y[m + i] = A[2 * m + i] * before[i] + A[3 * m + i] * before[m + i];
        for (Size j = 0; j < all->points; j++) {
            const double *of = all->F + (s * all->points + j) * m, *weights = all->weights + j * m;
            for (Size i = 0; i < m; i++) y[i] += weights[i] * of[i];
            for (Size i = 0; i < m; i++) y[m + i] += weights[all->points * m + i] * of[i];
        }
        before = y;
    }
}

/* What the text of inside() in loops.c says. */
typedef struct {
    Size S, points, m;
    const double *omega, *h, *before, *F;
    double *y;
    double *largest, *varied, *mean; /* (m) each, of a segment */
} Inside;

/* sqrt(x^2 + y^2), not below the larger one where squares vanish; nan where one is. */
INLINE double together(double x, double y)
{
    const double root = sqrt(x * x + y * y), larger = fabs(x) > fabs(y) ? fabs(x) : fabs(y);
    return root < larger ? larger : root;
}

INLINE void look_inside(const Inside *all)
{
    const Size m = all->m, points = all->points;
    double *RESTRICT largest = all->largest, *RESTRICT varied = all->varied, *RESTRICT mean = all->mean;
    for (Size s = 0; s < all->S; s++) {
        const double *F = all->F + s * points * m, *x = all->before + s * 2 * m, h = all->h[s];
        double *RESTRICT y = all->y + s * 2 * m;
        for (Size i = 0; i < m; i++) largest[i] = mean[i] = fabs(F[i]), varied[i] = 0.0;
        for (Size j = 1; j < points; j++)
            for (Size i = 0; i < m; i++) {
                const double f = F[j * m + i], size = fabs(f);
                largest[i] = size < largest[i] ? largest[i] : size; /* nan stays in the sums */
                mean[i] += size;
                varied[i] += fabs(f - F[(j - 1) * m + i]);
            }
        for (Size i = 0; i < m; i++) {
            const double w = all->omega[i], square = w * w;
            const double about = together(w * (x[i] - F[i] / square), x[m + i]) + varied[i] / w;
            const double whole = together(w * x[i], x[m + i]) + h * (mean[i] / points);
            const double centre = largest[i] / square + about / w;
            y[i] = centre < whole / w || centre != centre ? centre : whole / w;
            y[m + i] = about < whole || about != about ? about : whole;
        }
    }
}
