// The kernels, with and without AVX2, against Eigen.
#include "estimation/filter/dense_kernels.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

namespace fiducap::dense {
namespace {

constexpr double kSame = 1e-13;  // relative: another order of summation
// Whole tiles, and every kind of rest.
constexpr int kSizes[] = {1, 2, 3, 4, 6, 8, 11, 24, 31, 60};

struct Kernels {
  void (*factor)(View, Index);
  void (*divide)(ConstView, Index, View, Index);
  void (*subtract_square)(View, Index, ConstView, Index, std::span<const unsigned char>);
  void (*multiply_difference)(ConstView, ConstView, ConstView, View, Index);
  void (*add_product)(ConstView, Index, ConstView, View, Index, Width);
};

class DenseKernels : public testing::TestWithParam<bool> {
 protected:
  DenseKernels() {
    if (GetParam()) {
      kernels_ = {portable::factor, portable::divide, portable::subtract_square,
                  portable::multiply_difference, portable::add_product};
    } else {
      kernels_ = {factor, divide, subtract_square, multiply_difference, add_product};
    }
  }

  /// Part of a larger matrix, as everything is in the filter.
  static View corner(Eigen::MatrixXd& whole) { return {whole.data(), whole.outerStride()}; }
  static Eigen::MatrixXd scatter(int m) {
    const Eigen::MatrixXd A = Eigen::MatrixXd::Random(m, m);
    return A * A.transpose() + Eigen::MatrixXd::Identity(m, m);
  }
  static void expect_near(const Eigen::MatrixXd& got, const Eigen::MatrixXd& expected) {
    EXPECT_LT((got - expected).norm(), kSame * expected.norm());
  }

  Kernels kernels_{};
};

TEST_P(DenseKernels, FactorAndDivideLikeEigen) {
  for (const int m : kSizes) {
    for (const int rows : kSizes) {
      Eigen::MatrixXd S = Eigen::MatrixXd::Constant(m + 3, m + 2, 7);
      Eigen::MatrixXd B = Eigen::MatrixXd::Constant(rows + 3, m + 2, 7);
      const Eigen::MatrixXd S_before = scatter(m);
      const Eigen::MatrixXd B_before = Eigen::MatrixXd::Random(rows, m);
      S.topLeftCorner(m, m) = S_before;
      B.topLeftCorner(rows, m) = B_before;
      kernels_.factor(corner(S), m);
      kernels_.divide(corner(S), m, corner(B), rows);
      const Eigen::MatrixXd L = S_before.llt().matrixL();
      expect_near(S.topLeftCorner(m, m).triangularView<Eigen::Lower>(), L);
      expect_near(B.topLeftCorner(rows, m),
                  L.triangularView<Eigen::Lower>().solve(B_before.transpose()).transpose());
      EXPECT_TRUE((B.bottomRows(3).array() == 7).all() && (B.rightCols(2).array() == 7).all())
          << "wrote beyond";
      EXPECT_TRUE((S.bottomRows(3).array() == 7).all() && (S.rightCols(2).array() == 7).all())
          << "wrote beyond";
    }
  }
}

TEST_P(DenseKernels, ADirectionWithoutVarianceGivesNoInformation) {
  for (const int m : kSizes) {
    Eigen::MatrixXd S = scatter(m);
    const int empty = m / 2;
    S.row(empty).setZero();
    S.col(empty).setZero();
    Eigen::MatrixXd B = Eigen::MatrixXd::Random(9, m);
    kernels_.factor(corner(S), m);
    kernels_.divide(corner(S), m, corner(B), 9);
    EXPECT_TRUE(B.col(empty).isZero(0));
    EXPECT_TRUE(B.allFinite());
  }
}

TEST_P(DenseKernels, SubtractSquareLikeEigen) {
  for (const int n : kSizes) {
    for (const int m : kSizes) {
      Eigen::MatrixXd P = Eigen::MatrixXd::Constant(n + 3, n + 2, 7);
      const Eigen::MatrixXd before = scatter(n);
      P.topLeftCorner(n, n) = before;
      Eigen::MatrixXd G = Eigen::MatrixXd::Random(n + 1, m);
      kernels_.subtract_square(corner(P), n, corner(G), m, {});
      const Eigen::MatrixXd got = P.topLeftCorner(n, n);
      expect_near(got, before - G.topRows(n) * G.topRows(n).transpose());
      EXPECT_EQ(got, got.transpose());
      EXPECT_TRUE((P.bottomRows(3).array() == 7).all() && (P.rightCols(2).array() == 7).all())
          << "wrote beyond";
    }
  }
}

TEST_P(DenseKernels, HeldElementsAreUnchanged) {
  constexpr int kRows = 51;
  constexpr int kDepth = 12;
  // Held: nothing, some here and there, whole tiles, everything.
  for (const auto& [first, last, step] :
       {std::array{0, 0, 1}, {3, 40, 7}, {15, 45, 1}, {0, kRows, 1}}) {
    std::vector<unsigned char> held(kRows, 0);
    for (int i = first; i < last; i += step) held[static_cast<std::size_t>(i)] = 1;
    const Eigen::MatrixXd before = scatter(kRows);
    Eigen::MatrixXd P = before;
    Eigen::MatrixXd G = Eigen::MatrixXd::Random(kRows, kDepth);
    kernels_.subtract_square(corner(P), kRows, corner(G), kDepth, held);
    Eigen::MatrixXd expected = before - G * G.transpose();
    for (int i = 0; i < kRows; ++i) {
      for (int j = 0; j < kRows; ++j) {
        if (!held[static_cast<std::size_t>(i)] || !held[static_cast<std::size_t>(j)]) continue;
        expected(i, j) = before(i, j);
        EXPECT_EQ(P(i, j), before(i, j));
      }
    }
    expect_near(P, expected);
  }
}

TEST_P(DenseKernels, MultiplyDifferenceLikeEigen) {
  for (const int n : kSizes) {
    Eigen::MatrixXd A = Eigen::MatrixXd::Random(n + 2, 6);
    Eigen::MatrixXd B = Eigen::MatrixXd::Random(n + 1, 6);
    Eigen::MatrixXd U = Eigen::MatrixXd::Random(6, 6).triangularView<Eigen::Upper>();
    Eigen::MatrixXd G = Eigen::MatrixXd::Constant(n + 3, 6, 7);
    kernels_.multiply_difference(corner(A), corner(B), corner(U), corner(G), n);
    expect_near(G.topRows(n), (A.topRows(n) - B.topRows(n)) * U.transpose());
    EXPECT_TRUE((G.bottomRows(3).array() == 7).all()) << "wrote beyond";
    kernels_.multiply_difference({nullptr, 0}, corner(B), corner(U), corner(G), n);
    expect_near(G.topRows(n), -B.topRows(n) * U.transpose());
  }
}

TEST_P(DenseKernels, AddProductLikeEigen) {
  for (const auto& [cols, width] : {std::pair{3, Width::kThree}, {6, Width::kSix}}) {
    for (const int n : kSizes) {
      for (const int depth : {1, 3, 5, 12}) {
        Eigen::MatrixXd C = Eigen::MatrixXd::Random(n + 2, depth);
        Eigen::MatrixXd V = Eigen::MatrixXd::Random(cols, depth);
        Eigen::MatrixXd G = Eigen::MatrixXd::Constant(n + 3, cols + 1, 7);
        const Eigen::MatrixXd before = Eigen::MatrixXd::Random(n, cols);
        G.topLeftCorner(n, cols) = before;
        kernels_.add_product(corner(C), depth, corner(V), corner(G), n, width);
        expect_near(G.topLeftCorner(n, cols), before + C.topRows(n) * V.transpose());
        EXPECT_TRUE((G.bottomRows(3).array() == 7).all() && (G.rightCols(1).array() == 7).all())
            << "wrote beyond";
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AsTheProcessorHasItAndPortable, DenseKernels, testing::Bool());

}  // namespace
}  // namespace fiducap::dense
