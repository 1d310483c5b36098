/* Filtered Hessians of isotropic energies of tetrahedra, eight cells at a time.
 *
 * In the frames of F = U S V' the Hessian over F of an isotropic energy psi(s0, s1, s2) falls apart into the 3 x 3 matrix of second
 * derivatives by the stretches and a 2 x 2 block per pair of axes with eigenvalues (psi_i - psi_j) / (s_i - s_j) and
 * (psi_i + psi_j) / (s_i + s_j) (Smith, de Goes, Kim 2019). Each is filtered by itself, and a cell's blocks follow from hat-function
 * gradients turned into the frame, without ever forming the 9 x 9 matrix. */
#include "../../positive.h"
#include "interface.h"
#include "kernel.h"

enum { LANES = 8 };
typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef int64_t mask __attribute__((vector_size(LANES * sizeof(int64_t))));

INLINE lanes all(double a)
{
    return (lanes){a, a, a, a, a, a, a, a};
}

INLINE lanes root(lanes a)
{
    lanes r;
    for (int l = 0; l < LANES; ++l)
        r[l] = sqrt(a[l]);
    return r;
}

INLINE lanes choose(mask m, lanes yes, lanes no)
{
    return (lanes)(((mask)yes & m) | ((mask)no & ~m));
}

INLINE lanes size(lanes a)
{
    return choose(a < all(0.0), -a, a);
}

/* Cyclic Jacobi of symmetric 3 x 3 matrices A (a00 a01 a02 a11 a12 a22): A becomes diagonal, the columns of V eigenvectors. */
INLINE void eigensystems(lanes A[3][3], lanes V[3][3])
{
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            V[i][j] = all(i == j);
    for (int sweep = 0; sweep < 12; ++sweep) {
        const lanes off = A[0][1] * A[0][1] + A[0][2] * A[0][2] + A[1][2] * A[1][2];
        const lanes diagonal = A[0][0] * A[0][0] + A[1][1] * A[1][1] + A[2][2] * A[2][2];
        int open = 0;
        for (int l = 0; l < LANES; ++l)
            open |= off[l] > 1e-30 * diagonal[l];
        if (!open)
            return;
        for (int p = 0; p < 2; ++p)
            for (int q = p + 1; q < 3; ++q) {
                const int o = 3 - p - q;
                const lanes apq = A[p][q], half = 0.5 * (A[q][q] - A[p][p]);
                /* t = tan of the smaller angle, written so that apq = 0 gives t = 0 without a division by zero. */
                const lanes length = root(half * half + apq * apq);
                const lanes below = size(half) + length;
                lanes t = apq / choose(below > all(0.0), below, all(1.0));
                t = choose(half < all(0.0), -t, t);
                const lanes c = 1.0 / root(t * t + 1.0), s = t * c;
                A[p][p] -= t * apq;
                A[q][q] += t * apq;
                A[p][q] = A[q][p] = all(0.0);
                const lanes aop = A[o][p], aoq = A[o][q];
                A[o][p] = A[p][o] = c * aop - s * aoq;
                A[o][q] = A[q][o] = s * aop + c * aoq;
                for (int k = 0; k < 3; ++k) {
                    const lanes vp = V[k][p], vq = V[k][q];
                    V[k][p] = c * vp - s * vq;
                    V[k][q] = s * vp + c * vq;
                }
            }
    }
}

/* Whether the symmetric 3 x 3 matrices of all lanes are positive definite, and not only just: by their leading minors. */
INLINE int all_definite(lanes A[3][3])
{
    const lanes minor = A[0][0] * A[1][1] - A[0][1] * A[0][1], product = A[0][0] * A[1][1];
    const lanes determinant = minor * A[2][2] - A[1][2] * (A[0][0] * A[1][2] - A[0][1] * A[0][2])
                              + A[0][2] * (A[0][1] * A[1][2] - A[1][1] * A[0][2]);
    const mask definite = (A[0][0] > all(0.0)) & (minor > 1e-10 * product) & (determinant > 1e-10 * (product * A[2][2]))
                          & (A[2][2] > all(0.0));
    int64_t every = -1;
    for (int l = 0; l < LANES; ++l)
        every &= definite[l];
    return every != 0;
}

/* What becomes of an eigenvalue: mode 0 keeps it, 1 cuts it off at zero, 2 takes its size. */
INLINE lanes positive(lanes a, int mode)
{
    if (mode == 0)
        return a;
    return mode == 1 ? choose(a < all(0.0), all(0.0), a) : size(a);
}

/* Adds weight times the Hessians of tetrahedra to blocks `out` (3 x 3 each), with slots and mode as in elements.c. */
void isotropic_hessians(const cells_t *cells, const stretches_t *density, const double *x, const int32_t *slots, int mode, double weight, double *out)
{
    const int64_t count = cells->count;
    const int np = density->np, ng = density->ng, nh = density->nh;
    const int32_t *arguments = density->arguments;
    for (int64_t first = 0; first < count; first += LANES) {
        const int used = count - first < LANES ? (int)(count - first) : LANES;
        lanes g[4][3], F[3][3], C[3][3], V[3][3], U[3][3], s[3], volume;
        {
            lanes e[3][3];
            for (int l = 0; l < LANES; ++l) {
                const int64_t k = first + (l < used ? l : 0); /* spare lanes repeat a cell, and are not added */
                const int32_t *dof = cells->vertices + 4 * k;
                for (int i = 0; i < 3; ++i)
                    for (int a = 0; a < 3; ++a) {
                        e[i][a][l] = x[3 * (int64_t)dof[i + 1] + a] - x[3 * (int64_t)dof[0] + a];
                        g[i + 1][a][l] = cells->inverse[9 * k + 3 * i + a];
                    }
                volume[l] = cells->volumes[k];
            }
            for (int a = 0; a < 3; ++a)
                for (int j = 0; j < 3; ++j)
                    F[a][j] = e[0][a] * g[1][j] + e[1][a] * g[2][j] + e[2][a] * g[3][j];
        }
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                C[i][j] = F[0][i] * F[0][j] + F[1][i] * F[1][j] + F[2][i] * F[2][j];
        eigensystems(C, V);
        for (int q = 0; q < 3; ++q) {
            for (int a = 0; a < 3; ++a)
                U[a][q] = F[a][0] * V[0][q] + F[a][1] * V[1][q] + F[a][2] * V[2][q];
            s[q] = root(U[0][q] * U[0][q] + U[1][q] * U[1][q] + U[2][q] * U[2][q]);
            for (int a = 0; a < 3; ++a)
                U[a][q] /= s[q];
        }
        lanes p[3], S[3][3];
        for (int l = 0; l < LANES; ++l) {
            double all_of[3 + MAX_ISOTROPIC_PARAMETERS], w[3 + MAX_ISOTROPIC_PARAMETERS], first_by[3] = {0}, second_by[9] = {0};
            for (int q = 0; q < 3; ++q)
                all_of[q] = s[q][l];
            for (int q = 0; q < np; ++q)
                all_of[3 + q] = density->parameters[np * (first + (l < used ? l : 0)) + q];
            for (int i = 0; i < ng; ++i)
                w[i] = all_of[arguments[i]];
            CALL(density->gradient, first_by, w, 0, unit_simplex);
            for (int i = 0; i < nh; ++i)
                w[i] = all_of[arguments[ng + i]];
            CALL(density->hessian, second_by, w, 0, unit_simplex);
            for (int i = 0; i < 3; ++i) {
                p[i][l] = 6.0 * first_by[i]; /* the unit tetrahedron's volume is 1/6 */
                for (int j = 0; j < 3; ++j)
                    S[i][j][l] = 3.0 * (second_by[3 * i + j] + second_by[3 * j + i]);
            }
        }
        lanes same[3], cross[3]; /* of the axes other than o: H over (F_ij, F_ij) and over (F_ij, F_ji) */
        for (int o = 0; o < 3; ++o) {
            const int i = (o + 1) % 3, j = (o + 2) % 3;
            const lanes difference = s[i] - s[j], total = s[i] + s[j];
            const mask near = size(difference) < 1e-5 * total; /* there the quotient's limit is exact to second order */
            const lanes flip = choose(near, 0.5 * (S[i][i] + S[j][j]) - S[i][j], (p[i] - p[j]) / choose(near, total, difference));
            const lanes twist = (p[i] + p[j]) / total;
            const lanes even = positive(flip, mode), odd = positive(twist, mode);
            same[o] = 0.5 * (even + odd);
            cross[o] = 0.5 * (even - odd);
        }
        if (mode && !all_definite(S)) {
            lanes A[3][3], Q[3][3];
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    A[i][j] = S[i][j];
            eigensystems(A, Q);
            const mask indefinite = (A[0][0] < all(0.0)) | (A[1][1] < all(0.0)) | (A[2][2] < all(0.0));
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j) {
                    lanes sum = all(0.0);
                    for (int q = 0; q < 3; ++q)
                        sum += positive(A[q][q], mode) * Q[i][q] * Q[j][q];
                    S[i][j] = choose(indefinite, sum, S[i][j]);
                }
        }
        /* Hat-function gradients in the frame: h_a = V' g_a; K_ab = U k_ab U' with k_ab from S, same and cross. */
        lanes h[3][3];
        for (int a = 0; a < 3; ++a)
            for (int q = 0; q < 3; ++q)
                h[a][q] = g[a + 1][0] * V[0][q] + g[a + 1][1] * V[1][q] + g[a + 1][2] * V[2][q];
        lanes K[4][4][3][3];
        for (int a = 0; a < 3; ++a)
            for (int b = a; b < 3; ++b) {
                lanes k[3][3], t[3][3];
                for (int i = 0; i < 3; ++i)
                    for (int j = 0; j < 3; ++j) {
                        if (i == j) {
                            const int m = (i + 1) % 3, n = (i + 2) % 3; /* the axes of (i, m) leave n out, and the other way round */
                            k[i][i] = S[i][i] * h[a][i] * h[b][i] + same[n] * h[a][m] * h[b][m] + same[m] * h[a][n] * h[b][n];
                        } else {
                            k[i][j] = S[i][j] * h[a][i] * h[b][j] + cross[3 - i - j] * h[a][j] * h[b][i];
                        }
                    }
                const lanes scale = weight * volume;
                for (int i = 0; i < 3; ++i)
                    for (int j = 0; j < 3; ++j)
                        t[i][j] = scale * (k[i][0] * U[j][0] + k[i][1] * U[j][1] + k[i][2] * U[j][2]);
                for (int i = 0; i < 3; ++i)
                    for (int j = 0; j < 3; ++j)
                        K[a + 1][b + 1][i][j] = U[i][0] * t[0][j] + U[i][1] * t[1][j] + U[i][2] * t[2][j];
            }
        /* Translations are free: the first vertex's blocks balance the others'. */
        for (int b = 1; b < 4; ++b)
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j) {
                    lanes sum = all(0.0);
                    for (int a = 1; a < 4; ++a)
                        sum += a <= b ? K[a][b][i][j] : K[b][a][j][i];
                    K[0][b][i][j] = -sum;
                }
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                K[0][0][i][j] = -(K[0][1][i][j] + K[0][2][i][j] + K[0][3][i][j]);
        for (int l = 0; l < used; ++l) {
            const int32_t *slot = slots + 10 * (first + l);
            for (int a = 0; a < 4; ++a)
                for (int b = a; b < 4; ++b, ++slot) {
                    if (*slot >= 0) {
                        double *block = out + 9 * (int64_t)*slot;
                        for (int i = 0; i < 3; ++i)
                            for (int j = 0; j < 3; ++j)
                                block[3 * i + j] += K[a][b][i][j][l];
                    } else if (*slot <= -2) {
                        double *block = out + 9 * (int64_t)(-2 - *slot);
                        for (int i = 0; i < 3; ++i)
                            for (int j = 0; j < 3; ++j)
                                block[3 * j + i] += K[a][b][i][j][l];
                    }
                }
        }
    }
}
