#include "tubetrack/tracker/recycled.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>
#include <utility>

namespace tubetrack {
namespace {

bool is_aligned(const void* memory) {
  return reinterpret_cast<std::uintptr_t>(memory) % 64 == 0;
}

TEST(Recycled, MatrixTakesTheSizeOfWhatIsAssigned) {
  RecycledMatrix matrix;
  EXPECT_EQ(matrix.size(), 0);
  matrix = Eigen::MatrixXd::Identity(3, 3);
  EXPECT_TRUE(matrix.isIdentity(0.0));
  matrix = Eigen::MatrixXd::Constant(2, 5, 7.0);
  EXPECT_EQ(matrix.rows(), 2);
  EXPECT_EQ(matrix.cols(), 5);
  matrix.setZero(4, 1);
  EXPECT_EQ(matrix, RecycledMatrix(Eigen::MatrixXd::Zero(4, 1)));
  EXPECT_EQ(RecycledColumn().cols(), 1);
}

TEST(Recycled, MatrixMayBeAssignedWhatIsMadeOfItself) {
  RecycledMatrix matrix = Eigen::MatrixXd::Random(4, 4);
  const Eigen::MatrixXd before = matrix;
  matrix = matrix.transpose() * matrix;
  EXPECT_TRUE(matrix.isApprox(before.transpose() * before));
  const Eigen::MatrixXd square = matrix;
  matrix = matrix.bottomRightCorner(2, 3);
  EXPECT_EQ(matrix, RecycledMatrix(square.bottomRightCorner(2, 3)));
}

TEST(Recycled, CopiesAreIndependentAndMovesLeaveAValidMatrix) {
  RecycledColumn one = Eigen::VectorXd::Ones(5);
  RecycledColumn copy = one;
  copy[0] = 2.0;
  EXPECT_EQ(one[0], 1.0);
  const RecycledColumn moved = std::move(one);
  EXPECT_EQ(moved.size(), 5);
  one = copy;
  EXPECT_EQ(one, copy);
  one = std::as_const(one);
  EXPECT_EQ(one, copy);
}

TEST(Recycled, BlocksAreAlignedAndOfAnySize) {
  for (std::size_t bytes = 1; bytes < (std::size_t{1} << 28); bytes = 3 * bytes + 1) {
    void* const memory = take_memory(bytes);
    EXPECT_TRUE(is_aligned(memory)) << bytes;
    static_cast<char*>(memory)[bytes - 1] = 1;
    give_back_memory(memory, bytes);
  }
  EXPECT_EQ(take_memory(0), nullptr);
  give_back_memory(nullptr, 0);
}

TEST(Recycled, MayBeGivenBackByAnotherThread) {
  RecycledVector<int> made;
  std::thread([&] { made.assign(1000, 3); }).join();
  EXPECT_EQ(made.back(), 3);
  std::thread([taken = std::move(made)] { EXPECT_EQ(taken.size(), 1000U); }).join();
}

}  // namespace
}  // namespace tubetrack
