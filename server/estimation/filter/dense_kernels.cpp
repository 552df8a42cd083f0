#include "estimation/filter/dense_kernels.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

// Everything is inlined into functions compiled for AVX2. No Eigen here: the linker could keep the
// AVX2 copy of one of its inline functions for the whole program.
#define FIDUCAP_INLINE [[gnu::always_inline]] inline

namespace fiducap::dense {

namespace {
constexpr int kCols = 4;   // of a tile
constexpr Index kSix = 6;  // numbers of a pose

// A tile has two packs of rows; remaining rows are single doubles.
typedef double Pair __attribute__((vector_size(16)));
typedef double Quad __attribute__((vector_size(32)));

template <class Pack>
inline constexpr int kLanes = static_cast<int>(sizeof(Pack) / sizeof(double));

template <class Pack>
FIDUCAP_INLINE void load(Pack& pack, const double* from) {
  std::memcpy(&pack, from, sizeof pack);
}

/// sum(:, c) = Σ_k A(:, k) B(c, k): packs × cols of a product A Bᵀ, kept in registers.
template <class Pack, int packs, int cols>
FIDUCAP_INLINE void multiply(const double* a, Index a_stride, const double* b, Index b_stride,
                             Index depth, Pack (&sum)[cols][packs]) {
  for (Index c = 0; c < cols; ++c) {
    for (Index p = 0; p < packs; ++p) sum[c][p] = Pack{};
  }
  for (Index left = depth; left > 0; --left, a += a_stride, b += b_stride) {
    Pack column[packs];
    for (Index p = 0; p < packs; ++p) load(column[p], a + p * kLanes<Pack>);
    for (Index c = 0; c < cols; ++c) {
      for (Index p = 0; p < packs; ++p) sum[c][p] += column[p] * b[c];
    }
  }
}

/// Columns j … j + cols of some rows of B L⁻ᵀ. @pre earlier columns are done
template <class Pack, int packs, int cols>
FIDUCAP_INLINE void divide_tile(const ConstView& L, Index j, double* b, Index stride) {
  Pack x[cols][packs];
  multiply<Pack, packs, cols>(b, stride, L.data + j, L.stride, j, x);
  for (Index c = 0; c < cols; ++c) {
    double* const column = b + (j + c) * stride;
    const double pivot = L.data[j + c + (j + c) * L.stride];
    const double inverse = pivot > 0 ? 1 / pivot : 0;
    for (Index p = 0; p < packs; ++p) {
      Pack value;
      load(value, column + p * kLanes<Pack>);
      value -= x[c][p];
      for (Index before = 0; before < c; ++before)
        value -= x[before][p] * L.data[j + c + (j + before) * L.stride];
      x[c][p] = value * inverse;
      std::memcpy(column + p * kLanes<Pack>, &x[c][p], sizeof(Pack));
    }
  }
}

/// All columns of some rows.
template <class Pack, int packs>
FIDUCAP_INLINE void divide_rows(const ConstView& L, Index m, double* b, Index stride) {
  Index j = 0;
  for (; j + kCols <= m; j += kCols) divide_tile<Pack, packs, kCols>(L, j, b, stride);
  for (; j < m; ++j) divide_tile<Pack, packs, 1>(L, j, b, stride);
}

template <class Pack>
FIDUCAP_INLINE void divide_all(const ConstView& L, Index m, const View& B, Index rows) {
  Index i = 0;
  for (; i + 2 * kLanes<Pack> <= rows; i += 2 * kLanes<Pack>)
    divide_rows<Pack, 2>(L, m, B.data + i, B.stride);
  for (; i + kLanes<Pack> <= rows; i += kLanes<Pack>)
    divide_rows<Pack, 1>(L, m, B.data + i, B.stride);
  for (; i < rows; ++i) divide_rows<double, 1>(L, m, B.data + i, B.stride);
}

/// Columns j … j + cols of L. @pre earlier columns are done
template <class Pack, int cols>
FIDUCAP_INLINE void factor_columns(const View& S, Index m, Index j) {
  // Only the lower triangle of these columns' own rows is used.
  double done[cols][cols];  // contribution of earlier columns: element (r, c) at [c][r]
  if constexpr (cols % kLanes<Pack> == 0) {
    Pack sum[cols][cols / kLanes<Pack>];
    multiply<Pack, cols / kLanes<Pack>, cols>(S.data + j, S.stride, S.data + j, S.stride, j, sum);
    std::memcpy(done, sum, sizeof done);
  } else {
    multiply<double, cols, cols>(S.data + j, S.stride, S.data + j, S.stride, j, done);
  }
  for (Index c = 0; c < cols; ++c) {
    double* const column = S.data + j + (j + c) * S.stride;
    for (Index r = c; r < cols; ++r) {
      double value = column[r] - done[c][r];
      for (Index k = 0; k < c; ++k) value -= done[k][r] * done[k][c];
      done[c][r] = column[r] =
          r > c ? (column[c] > 0 ? value / column[c] : 0) : (value > 0 ? std::sqrt(value) : 0);
    }
  }
  Index i = j + cols;
  for (; i + 2 * kLanes<Pack> <= m; i += 2 * kLanes<Pack>)
    divide_tile<Pack, 2, cols>(S, j, S.data + i, S.stride);
  for (; i + kLanes<Pack> <= m; i += kLanes<Pack>)
    divide_tile<Pack, 1, cols>(S, j, S.data + i, S.stride);
  for (; i < m; ++i) divide_tile<double, 1, cols>(S, j, S.data + i, S.stride);
}

template <class Pack>
FIDUCAP_INLINE void factor_all(const View& S, Index m) {
  Index j = 0;
  for (; j + kCols <= m; j += kCols) factor_columns<Pack, kCols>(S, m, j);
  for (; j < m; ++j) factor_columns<Pack, 1>(S, m, j);
}

/// Which rows or columns of a tile are held.
enum class Part { kAll, kSome, kNone };

FIDUCAP_INLINE Part held_part(std::span<const unsigned char> held, Index first, Index count) {
  if (held.empty()) return Part::kNone;
  const auto begin = held.begin() + first;
  const auto number = std::count_if(begin, begin + count, [](unsigned char h) { return h != 0; });
  return number == 0 ? Part::kNone : number == count ? Part::kAll : Part::kSome;
}

/// Rows i … and columns j … of P − G Gᵀ, and their mirror image.
template <class Pack, int packs, int cols>
FIDUCAP_INLINE void subtract_tile(const View& P, const ConstView& G, Index m, Index i, Index j,
                                  Part held_columns, std::span<const unsigned char> held) {
  constexpr int rows = packs * kLanes<Pack>;
  const Part held_rows = held_columns == Part::kNone ? Part::kNone : held_part(held, i, rows);
  if (held_rows == Part::kAll && held_columns == Part::kAll) return;
  Pack sum[cols][packs];
  multiply<Pack, packs, cols>(G.data + i, G.stride, G.data + j, G.stride, m, sum);
  double value[cols][rows];
  std::memcpy(value, sum, sizeof value);
  if (held_rows != Part::kNone) {
    for (Index c = 0; c < cols; ++c) {
      for (Index r = 0; r < rows; ++r)
        if (held[static_cast<std::size_t>(i + r)] && held[static_cast<std::size_t>(j + c)])
          value[c][r] = 0;
    }
  }
  const bool on_diagonal = i < j + cols;
  for (Index c = 0; c < cols; ++c) {
    double* const column = P.data + i + (j + c) * P.stride;
    for (Index r = on_diagonal ? std::max<Index>(0, j + c - i) : 0; r < rows; ++r)
      column[r] = value[c][r] = column[r] - value[c][r];
  }
  for (Index r = 0; r < rows; ++r) {
    double* const mirrored = P.data + j + (i + r) * P.stride;
    for (Index c = 0; c < (on_diagonal ? std::min<Index>(cols, i + r - j) : cols); ++c)
      mirrored[c] = value[c][r];
  }
}

template <class Pack, int cols>
FIDUCAP_INLINE void subtract_columns(const View& P, Index n, const ConstView& G, Index m, Index j,
                                     std::span<const unsigned char> held) {
  const Part held_columns = held_part(held, j, cols);
  Index i = j;
  for (; i + 2 * kLanes<Pack> <= n; i += 2 * kLanes<Pack>)
    subtract_tile<Pack, 2, cols>(P, G, m, i, j, held_columns, held);
  for (; i + kLanes<Pack> <= n; i += kLanes<Pack>)
    subtract_tile<Pack, 1, cols>(P, G, m, i, j, held_columns, held);
  for (; i < n; ++i) subtract_tile<double, 1, cols>(P, G, m, i, j, held_columns, held);
}

template <class Pack>
FIDUCAP_INLINE void subtract_all(const View& P, Index n, const ConstView& G, Index m,
                                 std::span<const unsigned char> held) {
  Index j = 0;
  for (; j + kCols <= n; j += kCols) subtract_columns<Pack, kCols>(P, n, G, m, j, held);
  for (; j < n; ++j) subtract_columns<Pack, 1>(P, n, G, m, j, held);
}

/// Some rows of (A − B) Uᵀ.
template <class Pack>
FIDUCAP_INLINE void multiply_rows(const ConstView& A, const ConstView& B, const ConstView& U,
                                  const View& G, Index i) {
  Pack apart[kSix];
  for (Index c = 0; c < kSix; ++c) {
    Pack minus;
    load(minus, B.data + i + c * B.stride);
    if (A.data == nullptr) {
      apart[c] = -minus;
    } else {
      load(apart[c], A.data + i + c * A.stride);
      apart[c] -= minus;
    }
  }
  for (Index c = 0; c < kSix; ++c) {
    Pack sum = apart[c] * U.data[c + c * U.stride];
    for (Index k = c + 1; k < kSix; ++k) sum += apart[k] * U.data[c + k * U.stride];
    std::memcpy(G.data + i + c * G.stride, &sum, sizeof sum);
  }
}

/// Some rows of G + C Vᵀ.
template <class Pack, int packs, int cols>
FIDUCAP_INLINE void add_rows(const ConstView& C, Index depth, const ConstView& V, const View& G,
                             Index i) {
  Pack sum[cols][packs];
  multiply<Pack, packs, cols>(C.data + i, C.stride, V.data, V.stride, depth, sum);
  for (Index c = 0; c < cols; ++c) {
    for (Index p = 0; p < packs; ++p) {
      double* const at = G.data + i + p * kLanes<Pack> + c * G.stride;
      Pack value;
      load(value, at);
      value += sum[c][p];
      std::memcpy(at, &value, sizeof value);
    }
  }
}

template <class Pack, int cols>
FIDUCAP_INLINE void add_all(const ConstView& C, Index depth, const ConstView& V, const View& G,
                            Index n) {
  Index i = 0;
  for (; i + 2 * kLanes<Pack> <= n; i += 2 * kLanes<Pack>)
    add_rows<Pack, 2, cols>(C, depth, V, G, i);
  for (; i + kLanes<Pack> <= n; i += kLanes<Pack>) add_rows<Pack, 1, cols>(C, depth, V, G, i);
  for (; i + kLanes<Pair> <= n; i += kLanes<Pair>) add_rows<Pair, 1, cols>(C, depth, V, G, i);
  for (; i < n; ++i) add_rows<double, 1, cols>(C, depth, V, G, i);
}

template <class Pack>
FIDUCAP_INLINE void add_all(const ConstView& C, Index depth, const ConstView& V, const View& G,
                            Index n, Width width) {
  width == Width::kThree ? add_all<Pack, 3>(C, depth, V, G, n)
                         : add_all<Pack, kSix>(C, depth, V, G, n);
}

template <class Pack>
FIDUCAP_INLINE void multiply_all(const ConstView& A, const ConstView& B, const ConstView& U,
                                 const View& G, Index n) {
  Index i = 0;
  for (; i + kLanes<Pack> <= n; i += kLanes<Pack>) multiply_rows<Pack>(A, B, U, G, i);
  for (; i < n; ++i) multiply_rows<double>(A, B, U, G, i);
}
}  // namespace

namespace portable {
void factor(View S, Index m) { factor_all<Pair>(S, m); }
void divide(ConstView L, Index m, View B, Index rows) { divide_all<Pair>(L, m, B, rows); }
void subtract_square(View P, Index n, ConstView G, Index m, std::span<const unsigned char> held) {
  subtract_all<Pair>(P, n, G, m, held);
}
void multiply_difference(ConstView A, ConstView B, ConstView U, View G, Index n) {
  multiply_all<Pair>(A, B, U, G, n);
}
void add_product(ConstView C, Index depth, ConstView V, View G, Index n, Width width) {
  add_all<Pair>(C, depth, V, G, n, width);
}
}  // namespace portable

#if defined(__x86_64__)
#define FIDUCAP_AVX2 __attribute__((target("avx2,fma")))
#define FIDUCAP_HAS_AVX2 (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
#else
#define FIDUCAP_AVX2
#define FIDUCAP_HAS_AVX2 false
#endif

namespace {
const bool has_avx2 = FIDUCAP_HAS_AVX2;
FIDUCAP_AVX2 void factor_avx2(const View& S, Index m) { factor_all<Quad>(S, m); }
FIDUCAP_AVX2 void divide_avx2(const ConstView& L, Index m, const View& B, Index rows) {
  divide_all<Quad>(L, m, B, rows);
}
FIDUCAP_AVX2 void subtract_avx2(const View& P, Index n, const ConstView& G, Index m,
                                std::span<const unsigned char> held) {
  subtract_all<Quad>(P, n, G, m, held);
}
FIDUCAP_AVX2 void multiply_avx2(const ConstView& A, const ConstView& B, const ConstView& U,
                                const View& G, Index n) {
  multiply_all<Quad>(A, B, U, G, n);
}
FIDUCAP_AVX2 void add_avx2(const ConstView& C, Index depth, const ConstView& V, const View& G,
                           Index n, Width width) {
  add_all<Quad>(C, depth, V, G, n, width);
}
}  // namespace

void factor(View S, Index m) { has_avx2 ? factor_avx2(S, m) : portable::factor(S, m); }
void divide(ConstView L, Index m, View B, Index rows) {
  has_avx2 ? divide_avx2(L, m, B, rows) : portable::divide(L, m, B, rows);
}
void subtract_square(View P, Index n, ConstView G, Index m, std::span<const unsigned char> held) {
  has_avx2 ? subtract_avx2(P, n, G, m, held) : portable::subtract_square(P, n, G, m, held);
}
void multiply_difference(ConstView A, ConstView B, ConstView U, View G, Index n) {
  has_avx2 ? multiply_avx2(A, B, U, G, n) : portable::multiply_difference(A, B, U, G, n);
}
void add_product(ConstView C, Index depth, ConstView V, View G, Index n, Width width) {
  has_avx2 ? add_avx2(C, depth, V, G, n, width) : portable::add_product(C, depth, V, G, n, width);
}

}  // namespace fiducap::dense
