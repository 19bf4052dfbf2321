/* The loop of Steps.march in estimates/march.py, where all columns share the reading of a step's matrices. */

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

/* Coordinates of a column that are held at zero. */
typedef struct {
    Size column, count;
    const long long *coordinates;
} Hold;

/* What the text of march() in loops.c says. */
typedef struct {
    Size columns, S, k, n, holds;
    const double *moving, *right, *kicks, *ahead, *onward;
    const double *moved, *whole, *inverses; /* of all steps */
    const char *once;
    Hold *hold;
    double *states, *multipliers;
    Size *from, *place;         /* columns that are marched; which of these each column is, -1: none, for it is 0 */
    double *now;                /* (columns, 4, k) of those that are marched */
    double *z, *left, *more, *held; /* (columns, n) of a step, three times; what solve() needs of k */
} March;

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

/* Solve A x = b for what replaces b, A (count, count) with b as one more column; whether there is a solution. */
INLINE int solve(Size count, double *A)
{
    const Size row = count + 1;
    for (Size i = 0; i < count; i++) {
        Size largest = i;
        for (Size j = i + 1; j < count; j++)
            if (fabs(A[j * row + i]) > fabs(A[largest * row + i])) largest = j;
        for (Size l = i; largest > i && l < row; l++) {
            const double other = A[i * row + l];
            A[i * row + l] = A[largest * row + l], A[largest * row + l] = other;
        }
        if (A[i * row + i] == 0.0) return 0;
        for (Size j = i + 1; j < count; j++) {
            const double factor = A[j * row + i] / A[i * row + i];
            for (Size l = i + 1; l < row; l++) A[j * row + l] -= factor * A[i * row + l];
        }
    }
    for (Size i = count - 1; i >= 0; i--) {
        double *b = A + i * row + count;
        for (Size j = i + 1; j < count; j++) *b -= A[i * row + j] * A[j * row + count];
        *b /= A[i * row + i];
    }
    return 1;
}

/* Take from solutions z (columns, n) of step i what moves coordinates that are held; whether that is possible. */
INLINE int let_go(const March *all, Size i, double *z)
{
    const Size n = all->n;
    const double *B = all->inverses + i * n * n;
    for (const Hold *hold = all->hold; hold < all->hold + all->holds; hold++) {
        const Size count = hold->count, row = count + 1, column = all->place[hold->column];
        const long long *J = hold->coordinates;
        double *of = z + column * n, *A = all->held;
        if (column < 0) continue; /* it is 0 all the same */
        for (Size a = 0; a < count; a++) {
            for (Size b = 0; b < count; b++) A[a * row + b] = B[J[a] * n + J[b]];
            A[a * row + count] = of[J[a]];
        }
        if (!solve(count, A)) return 0;
        for (Size l = 0; l < n; l++)
            for (Size b = 0; b < count; b++) of[l] -= B[l * n + J[b]] * A[b * row + count];
        for (Size b = 0; b < count; b++) of[J[b]] = 0.0; /* but for rounding they are */
    }
    return 1;
}

/* Whether numbers are those of y; 0, if that is NULL. */
INLINE int are_equal(Size count, const double *x, const double *y)
{
    for (Size l = 0; l < count; l++)
        if (x[l] != (y ? y[l] : 0.0)) return 0;
    return 1;
}

/* Whether what is given of column j is what is given of another one; 0, if that is negative. */
INLINE int is_like(const March *all, Size j, Size other)
{
    const Size sizes[] = {4 * all->k, all->S * all->n, all->S * 2 * all->k};
    const double *given[] = {all->moving, all->right, all->kicks};
    for (int i = 0; i < 3; i++)
        if (given[i] && !are_equal(sizes[i], given[i] + j * sizes[i], other < 0 ? NULL : given[i] + other * sizes[i]))
            return 0;
    return 1;
}

INLINE int is_held(const March *all, Size j)
{
    for (Size i = 0; i < all->holds; i++)
        if (all->hold[i].column == j) return 1;
    return 0;
}

/* Find the columns that differ, as distinct() in estimates/columns.py does; return how many these are. */
INLINE Size distinct(March *all)
{
    Size count = 0;
    for (Size j = 0; j < all->columns; j++) {
        Size like = is_held(all, j) ? count : 0;
        while (like < count && (is_held(all, all->from[like]) || !is_like(all, j, all->from[like]))) like++;
        all->place[j] = like < count ? like : is_like(all, j, -1) ? -1 : count;
        if (all->place[j] == count) all->from[count++] = j;
    }
    return count;
}

/* Replace some of four rows of k numbers by sums of all, by a map (rows, 4). */
INLINE void combine(Size k, const int rows, const double *map, double *RESTRICT x0, double *RESTRICT x1,
                    double *RESTRICT x2, double *RESTRICT x3)
{
    double by[16];
    memcpy(by, map, rows * 4 * sizeof(double));
    for (Size l = 0; l < k; l++) {
        const double a = x0[l], b = x1[l], c = x2[l], d = x3[l];
        x0[l] = by[0] * a + by[1] * b + by[2] * c + by[3] * d;
        x1[l] = by[4] * a + by[5] * b + by[6] * c + by[7] * d;
        x2[l] = by[8] * a + by[9] * b + by[10] * c + by[11] * d;
        if (rows == 4) x3[l] = by[12] * a + by[13] * b + by[14] * c + by[15] * d;
    }
}

/* Whether all could be held. */
INLINE int march(March *all)
{
    const Size S = all->S, k = all->k, n = all->n, c = n - k, columns = distinct(all);
    double *z = all->z, *left = all->left, *more = all->more;
    for (Size j = 0; j < columns; j++)
        memcpy(all->now + j * 4 * k, all->moving + all->from[j] * 4 * k, 4 * k * sizeof(double));
    for (Size i = 0; i < S; i++) {
        const double *inverse = all->inverses + i * n * n;
        for (Size j = 0; j < columns; j++) {
            const double *kick = all->kicks ? all->kicks + (all->from[j] * S + i) * 2 * k : NULL;
            double *e = all->now + j * 4 * k; /* what is known of e, e', a, until z is */
            combine(k, 3, all->ahead + 12 * i, e, e + k, e + 2 * k, e + 3 * k);
            for (Size l = 0; kick && l < 2 * k; l++) e[l] += kick[l];
        }
        product(n, 2 * k, columns, all->moved + i * n * 2 * k, all->now, 4 * k, left, n);
        for (Size j = 0; j < columns; j++) {
            const double *right = all->right + (all->from[j] * S + i) * n;
            for (Size l = 0; l < n; l++) left[j * n + l] = right[l] - left[j * n + l];
        }
        product(n, n, columns, inverse, left, n, z, n);
        if (!let_go(all, i, z)) return 0;
        if (!all->once[i]) {
            product(n, n, columns, all->whole + i * n * n, z, n, more, n);
            for (Size l = 0; l < columns * n; l++) left[l] -= more[l];
            product(n, n, columns, inverse, left, n, more, n);
            if (!let_go(all, i, more)) return 0;
            for (Size l = 0; l < columns * n; l++) z[l] += more[l];
        }
        for (Size j = 0; j < columns; j++) {
            double *e = all->now + j * 4 * k;
            memcpy(e + 3 * k, z + j * n, k * sizeof(double));
            combine(k, 4, all->onward + 16 * i, e, e + k, e + 2 * k, e + 3 * k);
        }
        for (Size j = 0; j < all->columns; j++) {
            const Size place = all->place[j];
            double *e = all->states + (i * all->columns + j) * 4 * k, *l = all->multipliers + (i * all->columns + j) * c;
            if (place < 0) {
                memset(e, 0, 4 * k * sizeof(double));
                memset(l, 0, c * sizeof(double));
            } else {
                memcpy(e, all->now + place * 4 * k, 4 * k * sizeof(double));
                memcpy(l, z + place * n + k, c * sizeof(double));
            }
        }
    }
    return 1;
}
