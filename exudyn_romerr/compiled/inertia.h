/* The loop of FrameInertia.force_and_masses in mbs/derivatives/frame_inertia.py, which tells its letters. */

#define INERTIA                                                                                                      \
    "inertia(S, n, states, constants, work, y)\n\nWrite y (2, S, n + 7), forces and masses in states (3, S, n + 7) of " \
    "a body of n modes; work: (15 n,).\nconstants: one behind the other as FrameInertia has them."

/* What that text says. */
typedef struct {
    Size S, n;
    const double *states, *constants;
    double *work, *y;
} Inertia;

INLINE void add_scaled(Size n, double a, const double *x, double *RESTRICT y)
{
    for (Size i = 0; i < n; i++) y[i] += a * x[i];
}

INLINE double dotted(Size n, const double *x, const double *y)
{
    double sum = 0.0;
    for (Size i = 0; i < n; i++) sum += x[i] * y[i];
    return sum;
}

INLINE void cross(const double *x, const double *y, double scale, double *to)
{
    for (int i = 0; i < 3; i++) to[i] += scale * (x[(i + 1) % 3] * y[(i + 2) % 3] - x[(i + 2) % 3] * y[(i + 1) % 3]);
}

INLINE void add_turned(const double *A, const double *x, double *to)
{
    for (int i = 0; i < 3; i++) to[i] += dotted(3, A + 3 * i, x);
}

/* A (3, 3) and G (3, 4) of Euler parameters, as in euler_parameters.py. */
INLINE void turn(const double *p, double *A, double *G)
{
    const double s = p[0], *v = p + 1, along = 1.0 - 2.0 * dotted(3, v, v);
    const double tilde[9] = {0.0, -v[2], v[1], v[2], 0.0, -v[0], -v[1], v[0], 0.0};
    for (int i = 0; i < 3; i++) {
        G[4 * i] = -2.0 * v[i];
        for (int j = 0; j < 3; j++) {
            A[3 * i + j] = along * (i == j) + 2.0 * v[i] * v[j] + 2.0 * s * tilde[3 * i + j];
            G[4 * i + 1 + j] = 2.0 * (s * (i == j) - tilde[3 * i + j]);
        }
    }
}

INLINE void weigh(const Inertia *all)
{
    const Size S = all->S, n = all->n, k = n + 7;
    const double *reference = all->constants, *mass = reference + 4, *centre = mass + 1, *inertia = centre + 3;
    const double *pull = inertia + 9, *moments = pull + 3 * n, *once = moments + 3 * n, *by_u = once + 9 * n;
    const double *twice = by_u + 3 * n * n, *M = twice + 9 * n * n, *D = M + n * n, *K = D + n * n; /* transposed */
    double *H = all->work, *gamma = H + 9 * n, *moved = gamma + 3 * n;
    for (Size s = 0; s < S; s++) {
        const double *q = all->states + s * k, *q_t = q + S * k, *q_tt = q_t + S * k;
        const double *u = q + 7, *u_t = q_t + 7, *u_tt = q_tt + 7;
        double *force = all->y + s * k, *masses = force + S * k, *modes = force + 7;
        double p[4], A[9], G[12], theta[9], of_rates[9] = {0}, chi[3], b[3], w[3], al[3];
        double by_rates[3], place[3], theta_w[3] = {0}, rates_w[3] = {0}, moment[3] = {0}, turning[3] = {0};
        for (int i = 0; i < 4; i++) p[i] = reference[i] + q[3 + i];
        turn(p, A, G);
        memcpy(H, once, 9 * n * sizeof(double));
        memcpy(gamma, moments, 3 * n * sizeof(double));
        memset(moved, 0, 3 * n * sizeof(double));
        memset(modes, 0, n * sizeof(double));
        for (Size j = 0; j < n; j++) {
            add_scaled(9 * n, u[j], twice + 9 * n * j, H);
            add_scaled(3 * n, u[j], by_u + 3 * n * j, gamma);
            add_scaled(3 * n, u_t[j], by_u + 3 * n * j, moved);
            add_scaled(n, u_tt[j], M + n * j, modes);
            add_scaled(n, u_t[j], D + n * j, modes);
            add_scaled(n, u[j], K + n * j, modes);
        }
        memcpy(theta, inertia, sizeof(theta));
        for (Size l = 0; l < n; l++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) {
                    theta[3 * i + j] += u[l] * (once[9 * l + 3 * i + j] + H[9 * l + 3 * j + i]);
                    of_rates[3 * i + j] += u_t[l] * H[9 * l + 3 * i + j];
                }
        for (int i = 0; i < 3; i++) {
            chi[i] = *mass * centre[i] + dotted(n, pull + n * i, u);
            by_rates[i] = dotted(n, pull + n * i, u_t);
            place[i] = dotted(n, pull + n * i, u_tt);
            b[i] = A[i] * q_tt[0] + A[3 + i] * q_tt[1] + A[6 + i] * q_tt[2];
            w[i] = dotted(4, G + 4 * i, q_t + 3), al[i] = dotted(4, G + 4 * i, q_tt + 3);
        }
        cross(w, chi, 1.0, turning);
        cross(al, chi, 1.0, place), cross(w, turning, 1.0, place), cross(w, by_rates, 2.0, place);
        add_turned(theta, w, theta_w), add_turned(of_rates, w, rates_w), add_turned(theta, al, moment);
        cross(chi, b, 1.0, moment), cross(w, theta_w, 1.0, moment);
        for (int i = 0; i < 3; i++) moment[i] += dotted(n, gamma + n * i, u_tt) + 2.0 * rates_w[i];
        for (int i = 0; i < 3; i++) {
            add_scaled(n, b[i], pull + n * i, modes);
            add_scaled(n, al[i], gamma + n * i, modes);
            add_scaled(n, 2.0 * w[i], moved + n * i, modes);
            force[i] = *mass * q_tt[i] + dotted(3, A + 3 * i, place), masses[i] = *mass;
        }
        for (Size l = 0; l < n; l++) {
            for (int i = 0; i < 9; i++) modes[l] -= H[9 * l + i] * w[i / 3] * w[i % 3];
            masses[7 + l] = M[(n + 1) * l];
        }
        for (int i = 0; i < 4; i++) {
            const double column[3] = {G[i], G[4 + i], G[8 + i]};
            double heavy[3] = {0};
            add_turned(theta, column, heavy);
            force[3 + i] = dotted(3, column, moment), masses[3 + i] = dotted(3, column, heavy);
        }
    }
}

static void weigh_anywhere(const Inertia *all) { weigh(all); }
static void (*weigh_here)(const Inertia *) = weigh_anywhere;
#ifdef WIDE
WIDE static void weigh_wide(const Inertia *all) { weigh(all); }
#endif

static PyObject *weighed(PyObject *self, PyObject *arguments)
{
    Inertia all = {0};
    PyObject *given[4], *result = NULL;
    if (!PyArg_ParseTuple(arguments, "nnOOOO", &all.S, &all.n, given, given + 1, given + 2, given + 3) ||
        !are_sizes(4, all.S, all.n, all.n, (Size)1024)) /* 1024: above 15 + 17 and 7 more a state */
        return NULL;
    Py_buffer views[4];
    Held held = {views, 0};
    const Size n = all.n, rows = all.S * (n + 7);
    if ((all.states = numbers(given[0], &held, 3 * rows, 'd', 0)) &&
        (all.constants = numbers(given[1], &held, 17 + 15 * n + 15 * n * n, 'd', 0)) &&
        (all.work = numbers(given[2], &held, 15 * n, 'd', PyBUF_WRITABLE)) &&
        (all.y = numbers(given[3], &held, 2 * rows, 'd', PyBUF_WRITABLE))) {
        weigh_here(&all);
        result = Py_NewRef(Py_None);
    }
    release(&held);
    return result;
}
