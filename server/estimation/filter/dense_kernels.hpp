#pragma once

#include <cstddef>
#include <span>

/// The dense work of a Kalman update, n²m and nm² multiplications, written for the machine it runs
/// on: on x86-64 with AVX2 and FMA where the processor has them (asked once, at run time), else
/// with what every build has. The two differ in the last digits. Nothing here allocates.
namespace fiducap::dense {

using Index = std::ptrdiff_t;

/// A column-major matrix somewhere in memory: element (i, j) is data[i + j * stride].
struct View {
  double* data{};
  Index stride{};
};

/// One that is only read.
struct ConstView {
  const double* data{};
  Index stride{};

  ConstView(const double* first, Index step) : data(first), stride(step) {}
  ConstView(const View& view) : data(view.data), stride(view.stride) {}  // NOLINT: it is one
};

/// Cholesky in place: the lower triangle of S, m × m, becomes L with S = L Lᵀ; what stands above it
/// is left alone. A pivot that is not positive (no covariance has one) becomes 0, and divide()
/// answers 0 for its column.
void factor(View S, Index m);

/// B ← B L⁻ᵀ, rows × m. @param L  of factor()
void divide(ConstView L, Index m, View B, Index rows);

/// P ← P − G Gᵀ, both triangles, exactly symmetric. P is n × n, G is n × m.
/// @param held  per row of P whether it is held: elements whose row and column both are stay what
/// they were. Empty: none is.
void subtract_square(View P, Index n, ConstView G, Index m, std::span<const unsigned char> held);

/// G ← (A − B) Uᵀ, all n × 6 but for U, which is 6 × 6 and upper triangular.
/// @param A  data may be nullptr: zero
void multiply_difference(ConstView A, ConstView B, ConstView U, View G, Index n);

/// Of an n × k matrix: k.
enum class Width { kThree, kSix };
/// G ← G + C Vᵀ: C is n × depth, V is width × depth, G is n × width.
void add_product(ConstView C, Index depth, ConstView V, View G, Index n, Width width = Width::kSix);

/// The same without AVX2, whatever the processor has: for the tests.
namespace portable {
void factor(View S, Index m);
void divide(ConstView L, Index m, View B, Index rows);
void subtract_square(View P, Index n, ConstView G, Index m, std::span<const unsigned char> held);
void multiply_difference(ConstView A, ConstView B, ConstView U, View G, Index n);
void add_product(ConstView C, Index depth, ConstView V, View G, Index n, Width width = Width::kSix);
}  // namespace portable

}  // namespace fiducap::dense
