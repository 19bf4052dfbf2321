/* Several numbers at once, and products y = A x with a matrix, which other loops are made of. */

#include <math.h>
#include <string.h>

#define LANES 4    /* numbers of a row at once */
#define TOGETHER 4 /* columns at once: with two rows, their sums stay in registers */

#ifdef __GNUC__
typedef double Lanes __attribute__((vector_size(32)));
#define ADD_PRODUCT(sum, a, b) sum += a * b
#else
typedef struct {
    double of[LANES];
} Lanes;
#define ADD_PRODUCT(sum, a, b) \
    for (int lane = 0; lane < LANES; lane++) sum.of[lane] += a.of[lane] * b.of[lane]
#endif

/* y = A x for some rows of A (., m) and some columns x (next_x numbers apart), constants where this is called. */
INLINE void block(const int rows, const int columns, Size m, const double *A, const double *x, Size next_x, double *y,
                  Size next_y)
{
    Lanes sums[8][TOGETHER], row[8], one;
    double of[LANES];
    Size l = 0;
    memset(sums, 0, sizeof(sums));
    for (; l + LANES <= m; l += LANES) {
        UNROLLED
        for (int i = 0; i < rows; i++) {
            memcpy(&row[i], A + i * m + l, sizeof(one));
            PREFETCH(A + (rows + i) * m + l); /* the next rows: matrices of many steps are far away */
        }
        UNROLLED
        for (int j = 0; j < columns; j++) {
            memcpy(&one, x + j * next_x + l, sizeof(one));
            UNROLLED
            for (int i = 0; i < rows; i++) { ADD_PRODUCT(sums[i][j], row[i], one); }
        }
    }
    UNROLLED
    for (int i = 0; i < rows; i++) {
        UNROLLED
        for (int j = 0; j < columns; j++) {
            memcpy(of, &sums[i][j], sizeof(of));
            double sum = (of[0] + of[2]) + (of[1] + of[3]);
            for (Size rest = l; rest < m; rest++) sum += A[i * m + rest] * x[j * next_x + rest];
            y[j * next_y + i] = sum;
        }
    }
}

#define ROWS(rows, columns) \
    for (; i + rows <= n; i += rows) block(rows, columns, m, A + i * m, x, next_x, y + i, next_y)

/* y = A x, A (n, m). */
INLINE void product(Size n, Size m, Size columns, const double *A, const double *x, Size next_x, double *y, Size next_y)
{
    for (; columns > 0; columns -= TOGETHER, x += TOGETHER * next_x, y += TOGETHER * next_y) {
        Size i = 0;
        if (columns >= TOGETHER) {
            ROWS(3, TOGETHER);
            ROWS(1, TOGETHER);
        } else if (columns == 3) {
            ROWS(3, 3);
            ROWS(1, 3);
        } else if (columns == 2) {
            ROWS(6, 2);
            ROWS(1, 2);
        } else {
            ROWS(8, 1);
            ROWS(4, 1);
            ROWS(1, 1);
        }
    }
}
