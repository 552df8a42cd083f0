#pragma once

#include <cstddef>
#include <span>

/// Dense kernels of a Kalman update (n²m and nm² multiplications): AVX2 and FMA on processors that
/// have them (tested once at run time), portable code otherwise. The two differ in the last digits.
/// Nothing here allocates.
namespace fiducap::dense {

using Index = std::ptrdiff_t;

/// A column-major matrix somewhere in memory: element (i, j) is data[i + j * stride].
struct View {
  double* data{};
  Index stride{};
};

/// A read-only view.
struct ConstView {
  const double* data{};
  Index stride{};

  ConstView(const double* first, Index step) : data(first), stride(step) {}
  ConstView(const View& view) : data(view.data), stride(view.stride) {}  // NOLINT: implicit
};

/// Cholesky in place: the lower triangle of S, m × m, becomes L with S = L Lᵀ; the upper one is not
/// changed. A pivot that is not positive becomes 0, and divide() yields 0 in its column.
void factor(View S, Index m);

/// B ← B L⁻ᵀ, rows × m. @param L  of factor()
void divide(ConstView L, Index m, View B, Index rows);

/// P ← P − G Gᵀ, both triangles, exactly symmetric. P is n × n, G is n × m.
/// @param held  per row of P whether it is held: elements with both row and column held are not
///              changed. Empty: none.
void subtract_square(View P, Index n, ConstView G, Index m, std::span<const unsigned char> held);

/// G ← (A − B) Uᵀ, all n × 6 but for U, which is 6 × 6 and upper triangular.
/// @param A  data may be nullptr: zero
void multiply_difference(ConstView A, ConstView B, ConstView U, View G, Index n);

/// Columns of a matrix.
enum class Width { kThree, kSix };
/// G ← G + C Vᵀ: C is n × depth, V is width × depth, G is n × width.
void add_product(ConstView C, Index depth, ConstView V, View G, Index n, Width width = Width::kSix);

/// The same without AVX2, for tests.
namespace portable {
void factor(View S, Index m);
void divide(ConstView L, Index m, View B, Index rows);
void subtract_square(View P, Index n, ConstView G, Index m, std::span<const unsigned char> held);
void multiply_difference(ConstView A, ConstView B, ConstView U, View G, Index n);
void add_product(ConstView C, Index depth, ConstView V, View G, Index n, Width width = Width::kSix);
}  // namespace portable

}  // namespace fiducap::dense
