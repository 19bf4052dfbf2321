/* Products of small matrices with a few columns, which stand side by side. */

#ifndef SMALL_PRODUCTS
#define SMALL_PRODUCTS

enum { ROWS = 4, WIDEST = 4 }; /* rows at once, whose sums wait for nothing but themselves, of so few columns */

/* y += a A x, A (n, m), x (m, c), y (n, c) */
INLINE void add(Size n, Size m, Size c, double a, const double *A, const double *RESTRICT x, double *RESTRICT y)
{
    Size i = 0;
    if (c <= WIDEST)
        for (; i + ROWS <= n; i += ROWS) {
            double sums[ROWS][WIDEST];
            for (Size r = 0; r < ROWS; r++)
                for (Size o = 0; o < c; o++) sums[r][o] = y[(i + r) * c + o];
            for (Size j = 0; j < m; j++)
                for (Size r = 0; r < ROWS; r++) {
                    const double f = a * A[(i + r) * m + j];
                    for (Size o = 0; o < c; o++) sums[r][o] += f * x[j * c + o];
                }
            for (Size r = 0; r < ROWS; r++)
                for (Size o = 0; o < c; o++) y[(i + r) * c + o] = sums[r][o];
        }
    for (; i < n; i++) {
        double *RESTRICT yi = y + i * c;
        for (Size j = 0; j < m; j++) {
            const double f = a * A[i * m + j], *xj = x + j * c;
            for (Size o = 0; o < c; o++) yi[o] += f * xj[o];
        }
    }
}

/* y += a A^T x, A (n, m), x (n, c), y (m, c) */
INLINE void add_transposed(Size n, Size m, Size c, double a, const double *A, const double *x, double *RESTRICT y)
{
    for (Size i = 0; i < n; i++) {
        const double *xi = x + i * c;
        for (Size j = 0; j < m; j++) {
            const double f = a * A[i * m + j];
            for (Size o = 0; o < c; o++) y[j * c + o] += f * xi[o];
        }
    }
}

#endif
