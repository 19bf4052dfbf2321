/* Matrices of steps: factors_of of mechanism_errors/factors.py; and frames that are turned to other axes. */

typedef struct {
    const Mechanism *of; /* its c1, c2, M, D, K, turns, spin, bodies */
    double *A, *work;    /* (T, n_a, n_a); s m numbers of the largest body */
} StepMatrices;

static Size matrices_work(const Mechanism *a)
{
    Size most = 0;
    for (Size b = 0; b < a->bodies; b++)
        if (a->body[b].s * a->body[b].m > most) most = a->body[b].s * a->body[b].m;
    return most;
}

/* Coupling to oscillators at step i, and what is left of these in the rows and columns of the body: A - up down^T. */
INLINE void take_oscillators(const StepMatrices *all, Size b, Size i)
{
    const Mechanism *a = all->of;
    const Oscillating *B = a->body + b;
    const Size s = B->s, m = B->m, at = i * s * m, n_a = a->n_a;
    const double c1 = a->c1[i], c2 = a->c2[i], *M = B->M + at, *D_back = B->D_back + at;
    const Turn *turn = a->turns + i * a->nodes + b; /* frames of bodies are the first nodes */
    double *up = (double *)B->up + at, *down = (double *)B->down + at, *soft = (double *)B->soft + i * m;
    double *across = all->work; /* down^T */
    for (Size j = 0; j < m; j++) soft[j] = 1 / (c1 + c2 * B->dampers[j] + B->springs[j]);
    for (Size r = 0; r < s; r++)
        for (Size j = 0; j < m; j++) {
            const Size k = r * m + j;
            up[k] = (c1 * M[k] + c2 * B->D[at + k] + B->K[at + k]) * soft[j];
            down[k] = c1 * M[k] + c2 * D_back[k] + B->K_back[at + k];
        }
    for (Size r = 0; r < 3; r++)
        for (Size l = 0; l < 3; l++)
            for (Size j = 0; j < m; j++)
                down[(3 + r) * m + j] += turn->B2[3 * l + r] * M[(3 + l) * m + j] + turn->B1[3 * l + r] * D_back[(3 + l) * m + j];
    for (Size r = 0; r < s; r++)
        for (Size j = 0; j < m; j++) across[j * s + r] = down[r * m + j];
    for (Size r = 0; r < s; r++) {
        double *RESTRICT row = all->A + (i * n_a + B->first + r) * n_a + B->first;
        for (Size j = 0; j < m; j++)
            for (Size q = 0; q < s; q++) row[q] -= up[r * m + j] * across[j * s + q];
    }
}

INLINE void make_matrices(const StepMatrices *all)
{
    const Mechanism *a = all->of;
    const Size n_a = a->n_a, square = n_a * n_a;
    for (Size i = 0; i < a->T; i++) {
        const double c1 = a->c1[i], c2 = a->c2[i], *M = a->M + i * square, *D = a->D + i * square, *K = a->K + i * square;
        double *A = all->A + i * square;
        for (Size j = 0; j < square; j++) A[j] = c1 * M[j] + c2 * D[j] + K[j];
        for (Size k = 0; k < a->nodes; k++) {
            const Turn *turn = a->turns + i * a->nodes + k;
            for (Size r = 0; r < n_a; r++) {
                const Size at = r * n_a + a->spin[k];
                for (Size l = 0; l < 3; l++)
                    for (Size q = 0; q < 3; q++)
                        A[at + q] += M[at + l] * turn->B2[3 * l + q] + D[at + l] * turn->B1[3 * l + q];
            }
        }
        for (Size b = 0; b < a->bodies; b++) take_oscillators(all, b, i);
    }
}

/* Of X (T, n, m), rows or columns from places on, of vectors (3,) one after the other, turned by A (T, 3, 3); -1: none. */
typedef struct {
    Size T, n, m, row, column;
    const double *A;
    double *X;
} Turned;

enum { VECTORS = 2 }; /* a shift, and a small rotation */

static void turn_frames(const Turned *all)
{
    const Size n = all->n, m = all->m;
    for (Size t = 0; t < all->T; t++) {
        const double *A = all->A + 9 * t;
        double *X = all->X + t * n * m;
        for (Size v = 0; v < VECTORS && all->row >= 0; v++) {
            double *RESTRICT x = X + (all->row + 3 * v) * m, *RESTRICT y = x + m, *RESTRICT z = y + m;
            for (Size j = 0; j < m; j++) {
                const double a = x[j], b = y[j], c = z[j];
                x[j] = A[0] * a + A[1] * b + A[2] * c;
                y[j] = A[3] * a + A[4] * b + A[5] * c;
                z[j] = A[6] * a + A[7] * b + A[8] * c;
            }
        }
        for (Size v = 0; v < VECTORS && all->column >= 0; v++)
            for (Size i = 0; i < n; i++) {
                double *x = X + i * m + all->column + 3 * v;
                const double a = x[0], b = x[1], c = x[2];
                for (Size r = 0; r < 3; r++) x[r] = A[3 * r] * a + A[3 * r + 1] * b + A[3 * r + 2] * c;
            }
    }
}
