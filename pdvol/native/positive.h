/* Symmetric matrices made positive semi-definite. */
#pragma once
#include "common.h"

enum { MAX_H = 9 };       /* rows */
enum { MAX_ROUNDS = 60 }; /* rounds of an iteration on a small matrix: most take two to ten */
#define ROUND_OFF 1e-15   /* relative size of what counts as zero: a few units in the last place */

/* In-place Cholesky attempt on a copy: 1 if A + shift is positive definite. */
INLINE int definite(int n, const double *A, double shift)
{
    double L[MAX_H * MAX_H];
    for (int j = 0; j < n; ++j) {
        double diagonal = A[j * n + j] + shift;
        for (int k = 0; k < j; ++k)
            diagonal -= L[j * n + k] * L[j * n + k];
        if (!(diagonal > 0.0))
            return 0;
        const double inverse = 1.0 / sqrt(diagonal);
        L[j * n + j] = sqrt(diagonal);
        for (int i = j + 1; i < n; ++i) {
            double s = A[i * n + j];
            for (int k = 0; k < j; ++k)
                s -= L[i * n + k] * L[j * n + k];
            L[i * n + j] = s * inverse;
        }
    }
    return 1;
}

/* Eigenvalues of the symmetric A, which is lost, and eigenvectors, the rows of V: Householder's tridiagonal form, then QL with implicit shifts
 * (Golub and Van Loan, chapter 8). */
INLINE void eigensystem(int n, double *A, double *values, double *V)
{
    double beside[MAX_H] = {0.0};
    for (int i = 0; i < n * n; ++i)
        V[i] = i % (n + 1) == 0;
    for (int k = 0; k < n - 1; ++k) {
        double v[MAX_H] = {0.0}, w[MAX_H] = {0.0}, rest = 0.0, along = 0.0;
        for (int i = k + 1; i < n; ++i)
            v[i] = A[k * n + i], rest += i > k + 1 ? v[i] * v[i] : 0.0;
        beside[k] = v[k + 1];
        if (rest == 0.0)
            continue;
        beside[k] = -copysign(sqrt(v[k + 1] * v[k + 1] + rest), v[k + 1]);
        v[k + 1] -= beside[k];
        const double factor = 2.0 / (v[k + 1] * v[k + 1] + rest);
        for (int i = k + 1; i < n; ++i) {
            for (int j = 0; j < n; ++j)
                w[j] += factor * v[i] * A[i * n + j];
        }
        for (int i = k + 1; i < n; ++i)
            along += 0.5 * factor * v[i] * w[i];
        for (int i = k + 1; i < n; ++i)
            w[i] -= along * v[i];
        for (int i = k + 1; i < n; ++i)
            for (int j = 0; j < n; ++j)
                A[i * n + j] -= v[i] * w[j] + w[i] * v[j];
        memset(w, 0, sizeof w);
        for (int i = k + 1; i < n; ++i)
            for (int j = 0; j < n; ++j)
                w[j] += factor * v[i] * V[i * n + j];
        for (int i = k + 1; i < n; ++i)
            for (int j = 0; j < n; ++j)
                V[i * n + j] -= v[i] * w[j];
    }
    for (int i = 0; i < n; ++i)
        values[i] = A[i * n + i];
    for (int l = 0; l < n; ++l)
        for (int round = 0; round < MAX_ROUNDS; ++round) {
            int m = l;
            while (m < n - 1 && fabs(beside[m]) > ROUND_OFF * (fabs(values[m]) + fabs(values[m + 1])))
                ++m;
            if (m == l)
                break;
            double g = (values[l + 1] - values[l]) / (2.0 * beside[l]), s = 1.0, c = 1.0, p = 0.0;
            g = values[m] - values[l] + beside[l] / (g + copysign(sqrt(g * g + 1.0), g));
            int i = m - 1;
            for (; i >= l; --i) {
                const double f = s * beside[i], b = c * beside[i], size = sqrt(f * f + g * g);
                beside[i + 1] = size;
                if (size == 0.0) {
                    values[i + 1] -= p, beside[m] = 0.0;
                    break;
                }
                s = f / size, c = g / size, g = values[i + 1] - p;
                const double r = (values[i] - g) * s + 2.0 * c * b;
                p = s * r, values[i + 1] = g + p, g = c * r - b;
                for (int k = 0; k < n; ++k) {
                    const double one = V[i * n + k], other = V[(i + 1) * n + k];
                    V[i * n + k] = c * one - s * other, V[(i + 1) * n + k] = s * one + c * other;
                }
            }
            if (i < l)
                values[l] -= p, beside[l] = g, beside[m] = 0.0;
        }
}

/* Replaces negative eigenvalues of the symmetric H by zero (mode 1) or by their absolute values (mode 2). */
INLINE void filter_full(int n, double *H, int mode)
{
    double A[MAX_H * MAX_H], V[MAX_H * MAX_H], values[MAX_H];
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j)
            A[i * n + j] = H[i * n + j] = 0.5 * (H[i * n + j] + H[j * n + i]);
    eigensystem(n, A, values, V);
    for (int k = 0; k < n; ++k)
        for (int i = 0; i < n && values[k] < 0.0; ++i)
            for (int j = 0; j < n; ++j)
                H[i * n + j] -= mode * values[k] * V[k * n + i] * V[k * n + j];
}

/* Makes the symmetric n x n matrix H positive semi-definite. Returns 1 if it changed. */
INLINE int filter(int n, double *H, int mode)
{
    double trace = 0.0;
    for (int i = 0; i < n; ++i)
        trace += fabs(H[i * n + i]);
    if (definite(n, H, 1e-13 * trace))
        return 0;
    filter_full(n, H, mode);
    return 1;
}
