// The sparse factor and the Schur complement against dense Eigen: random matrices of blocks, as a
// map graph has them.
#include "estimation/segment/normal_equations.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include <Eigen/LU>

#include "support/results.hpp"

namespace fiducap {
namespace {

// Rounding at condition numbers below 1e4.
constexpr double kRounding = 1e-10;
constexpr std::uint64_t kWorlds = 20;

/// A matrix by blocks, and the same one dense.
struct Pair {
  explicit Pair(const std::vector<int>& sizes)
      : blocks(sizes), dense(Eigen::MatrixXd::Zero(blocks.rows(), blocks.rows())) {}

  void add(int row, int column, const Eigen::MatrixXd& block) {
    blocks.add(row, column, block);
    auto at = dense.block(blocks.first(row), blocks.first(column), block.rows(), block.cols());
    at += block;
    if (row == column) return;
    dense.block(blocks.first(column), blocks.first(row), block.cols(), block.rows()) +=
        block.transpose();
  }

  /// Random measurements between two variables.
  void bind(int a, int b, std::mt19937_64& random) {
    const Eigen::MatrixXd Ja = gauss(blocks.size(a) + 2, blocks.size(a), random);
    const Eigen::MatrixXd Jb = gauss(blocks.size(a) + 2, blocks.size(b), random);
    add(a, a, Ja.transpose() * Ja);
    add(b, b, Jb.transpose() * Jb);
    add(a, b, Ja.transpose() * Jb);
  }

  static Eigen::MatrixXd gauss(Eigen::Index rows, Eigen::Index columns, std::mt19937_64& random) {
    std::normal_distribution<double> draw;
    return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return draw(random); });
  }

  [[nodiscard]] Eigen::MatrixXd part(const Eigen::MatrixXd& of, int row, int column) const {
    return of.block(blocks.first(row), blocks.first(column), blocks.size(row), blocks.size(column));
  }

  BlockMatrix blocks;
  Eigen::MatrixXd dense;
};

/// Nodes of 15 in two chains, cameras of 12 connected to every node of theirs, tags of 6 seen from
/// a few nodes; numbered at random.
Pair random_graph(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<int> sizes{15, 15, 15, 15, 15, 15, 12, 12, 6, 6, 6, 6, 6};
  std::vector<int> number(sizes.size());
  std::iota(number.begin(), number.end(), 0);
  std::shuffle(number.begin(), number.end(), random);
  std::vector<int> shuffled(sizes.size());
  for (std::size_t i = 0; i < sizes.size(); ++i)
    shuffled[static_cast<std::size_t>(number[i])] = sizes[i];
  Pair out(shuffled);
  const auto at = [&](int i) { return number[static_cast<std::size_t>(i)]; };
  for (int i = 0; i < 13; ++i) {
    const int rows = out.blocks.size(at(i));
    out.add(at(i), at(i), Eigen::MatrixXd::Identity(rows, rows));
  }
  for (const int node : {0, 1, 3, 4}) out.bind(at(node), at(node + 1), random);
  for (int node = 0; node < 6; ++node) {
    out.bind(at(node), at(6 + node / 3), random);
    for (int tag = 8; tag < 13; ++tag)
      if (random() % 3 == 0) out.bind(at(tag), at(node), random);
  }
  return out;
}

TEST(BlockMatrix, AddsABlockAboveTheDiagonalTransposed) {
  std::mt19937_64 random(1);
  BlockMatrix matrix({3, 2});
  const Eigen::MatrixXd above = Pair::gauss(3, 2, random);
  const Eigen::MatrixXd below = Pair::gauss(2, 3, random);
  matrix.add(0, 1, above);
  matrix.add(1, 0, below);
  ASSERT_EQ(matrix.column(0).size(), 1u) << "no diagonal block";
  EXPECT_EQ(matrix.column(0).at(1), above.transpose() + below);
  EXPECT_TRUE(matrix.column(1).empty());
}

TEST(BlockCholesky, SolvesForSeveralRightHandSidesAtOnce) {
  for (std::uint64_t seed = 1; seed <= kWorlds; ++seed) {
    const Pair graph = random_graph(seed);
    std::mt19937_64 random(seed);
    const Eigen::MatrixXd b = Pair::gauss(graph.blocks.rows(), 4, random);
    const auto factor = value_of(BlockCholesky::factor(graph.blocks));
    EXPECT_LT((factor.solve(b) - graph.dense.inverse() * b).cwiseAbs().maxCoeff(), kRounding);
  }
}

TEST(BlockCholesky, DampsTheDiagonalInProportion) {
  constexpr double kDamping = 0.3;
  const Pair graph = random_graph(5);
  std::mt19937_64 random(5);
  const Eigen::MatrixXd b = Pair::gauss(graph.blocks.rows(), 1, random);
  Eigen::MatrixXd damped = graph.dense;
  damped.diagonal() *= 1 + kDamping;
  const auto factor = value_of(BlockCholesky::factor(graph.blocks, kDamping));
  EXPECT_LT((factor.solve(b) - damped.inverse() * b).norm(), kRounding);
}

TEST(BlockCholesky, HasAllConnectedBlocksOfTheInverse) {
  for (std::uint64_t seed = 1; seed <= kWorlds; ++seed) {
    const Pair graph = random_graph(seed);
    auto factor = value_of(BlockCholesky::factor(graph.blocks));
    factor.invert();
    const Eigen::MatrixXd dense = graph.dense.inverse();
    int without_a_place = 0;
    for (int row = 0; row < graph.blocks.variables(); ++row) {
      for (int column = 0; column < graph.blocks.variables(); ++column) {
        const auto block = factor.inverse(row, column);
        ASSERT_EQ(block.has_value(), factor.inverse(column, row).has_value());
        if (!block) {
          ++without_a_place;
          continue;
        }
        EXPECT_LT((*block - graph.part(dense, row, column)).cwiseAbs().maxCoeff(), kRounding)
            << "seed " << seed << ", " << row << " " << column;
      }
    }
    EXPECT_GT(without_a_place, 0) << "otherwise as expensive as the whole inverse";
    for (int column = 0; column < graph.blocks.variables(); ++column)
      for (const auto& entry : graph.blocks.column(column))
        EXPECT_TRUE(factor.inverse(entry.first, column)) << "connected";
  }
}

TEST(NormalEquations, AreReducedByTheirFirstVariables) {
  for (std::uint64_t seed = 1; seed <= kWorlds; ++seed) {
    const Pair graph = random_graph(seed);
    std::mt19937_64 random(seed);
    std::vector<int> sizes;
    for (int i = 0; i < graph.blocks.variables(); ++i) sizes.push_back(graph.blocks.size(i));
    NormalEquations equations(sizes);
    equations.H = graph.blocks;
    equations.pull = Pair::gauss(graph.blocks.rows(), 1, random);
    equations.cost = 100;
    for (const int first : {0, 7}) {
      const Eigen::Index rows = graph.blocks.first(first);
      const Eigen::Index rest = graph.blocks.rows() - rows;
      const Eigen::MatrixXd across = graph.dense.bottomLeftCorner(rest, rows);
      const Eigen::MatrixXd by = across * graph.dense.topLeftCorner(rows, rows).inverse();
      const auto reduced = value_of(reduce(equations, first));
      const Eigen::MatrixXd H = graph.dense.bottomRightCorner(rest, rest) - by * across.transpose();
      EXPECT_LT((reduced.H - H).cwiseAbs().maxCoeff(), kRounding * H.norm());
      const Eigen::VectorXd pull = equations.pull.tail(rest) - by * equations.pull.head(rows);
      EXPECT_LT((reduced.pull - pull).norm(), kRounding * H.norm());
      const Eigen::VectorXd own =
          graph.dense.topLeftCorner(rows, rows).inverse() * equations.pull.head(rows);
      EXPECT_NEAR(reduced.cost, 100 - 0.5 * own.dot(equations.pull.head(rows)), 1e-6);
    }
  }
}

TEST(BlockCholesky, RefusesAnIndefiniteMatrix) {
  Pair graph = random_graph(7);
  ASSERT_TRUE(BlockCholesky::factor(graph.blocks));
  // More than what is known of the variable when all others are free; its own block stays positive.
  const Eigen::MatrixXd own = graph.part(graph.dense.inverse(), 4, 4).inverse();
  graph.add(4, 4, -1.01 * own);
  EXPECT_FALSE(BlockCholesky::factor(graph.blocks));
  BlockMatrix matrix({6, 6});
  matrix.add(0, 0, Eigen::MatrixXd::Identity(6, 6));
  EXPECT_FALSE(BlockCholesky::factor(matrix)) << "a variable without information";
}

TEST(BlockCholesky, SolvesForASingleVariable) {
  std::mt19937_64 random(11);
  Pair graph({6});
  const Eigen::MatrixXd J = Pair::gauss(9, 6, random);
  graph.add(0, 0, J.transpose() * J);
  auto factor = value_of(BlockCholesky::factor(graph.blocks));
  const Eigen::MatrixXd b = Pair::gauss(6, 2, random);
  EXPECT_LT((factor.solve(b) - graph.dense.inverse() * b).norm(), kRounding);
  factor.invert();
  EXPECT_LT((*factor.inverse(0, 0) - graph.dense.inverse()).norm(), kRounding);
}

TEST(BlockCholesky, SeparatesUnconnectedVariables) {
  std::mt19937_64 random(13);
  Pair graph({15, 6, 12, 6});
  for (int i = 0; i < 4; ++i) {
    const int rows = graph.blocks.size(i);
    graph.add(i, i, Eigen::MatrixXd::Identity(rows, rows));
  }
  graph.bind(0, 3, random);
  graph.bind(1, 2, random);
  auto factor = value_of(BlockCholesky::factor(graph.blocks));
  const Eigen::MatrixXd b = Pair::gauss(graph.blocks.rows(), 1, random);
  EXPECT_LT((factor.solve(b) - graph.dense.inverse() * b).norm(), kRounding);
  factor.invert();
  EXPECT_FALSE(factor.inverse(0, 1));
  EXPECT_FALSE(factor.inverse(3, 2));
  const auto bound = value_of(factor.inverse(3, 0));
  EXPECT_LT((bound - graph.part(graph.dense.inverse(), 3, 0)).norm(), kRounding);
}

}  // namespace
}  // namespace fiducap
