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
