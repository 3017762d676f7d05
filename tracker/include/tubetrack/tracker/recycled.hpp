#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <utility>
#include <vector>

namespace tubetrack {

/// Memory for what lives no longer than a frame or two. What a thread gives back it keeps, by size, and hands out
/// again, so that a frame which does as much as one before it asks the system for nothing. It is freed when the thread
/// ends. A block may be given back by another thread than the one that took it.
void* take_memory(std::size_t bytes);
/// `bytes` as when it was taken.
void give_back_memory(void* memory, std::size_t bytes) noexcept;

/// std::allocator with such memory.
template <typename T>
struct RecyclingAllocator {
  static_assert(alignof(T) <= 64);
  using value_type = T;

  RecyclingAllocator() = default;
  template <typename U>
  RecyclingAllocator(const RecyclingAllocator<U>& /*other*/) {}  // NOLINT(google-explicit-constructor): a container's

  T* allocate(std::size_t count) { return static_cast<T*>(take_memory(count * sizeof(T))); }
  void deallocate(T* memory, std::size_t count) noexcept { give_back_memory(memory, count * sizeof(T)); }
  bool operator==(const RecyclingAllocator&) const = default;
};

template <typename T>
using RecycledVector = std::vector<T, RecyclingAllocator<T>>;

/// An Eigen matrix or vector of any size with such memory; Eigen's own asks the system. Assigning to it gives it the
/// size of what is assigned, which may be made of itself; through noalias() it must have that size already.
template <typename Plain>
class Recycled : public Eigen::Map<Plain> {
  using Map = Eigen::Map<Plain>;

 public:
  Recycled() : Map(nullptr, 0, kNoColumns) {}
  /// Not set.
  explicit Recycled(Eigen::Index rows, Eigen::Index cols = 1)
      : Map(static_cast<double*>(take_memory(bytes_of(rows, cols))), rows, cols) {}
  template <typename Derived>
  Recycled(const Eigen::MatrixBase<Derived>& other)  // NOLINT(google-explicit-constructor): as Eigen's own
      : Recycled(other.rows(), other.cols()) {
    Map::noalias() = other.derived();
  }
  Recycled(const Recycled& other) : Recycled(static_cast<const Map&>(other)) {}
  Recycled(Recycled&& other) noexcept : Map(other.data(), other.rows(), other.cols()) {
    other.point_to(nullptr, 0, kNoColumns);
  }
  ~Recycled() { give_back_memory(this->data(), bytes_of(this->rows(), this->cols())); }

  template <typename Derived>
  Recycled& operator=(const Eigen::MatrixBase<Derived>& other) {
    Recycled fresh(other);
    swap(fresh);
    return *this;
  }
  Recycled& operator=(const Recycled& other) {
    if (&other == this) return *this;
    if (this->rows() != other.rows() || this->cols() != other.cols()) return *this = Recycled(other);
    Map::operator=(other);
    return *this;
  }
  Recycled& operator=(Recycled&& other) noexcept {
    swap(other);
    return *this;
  }

  /// Gives it a size; what it holds is not kept.
  void resize(Eigen::Index rows, Eigen::Index cols = 1) {
    if (rows * cols != this->rows() * this->cols()) *this = Recycled(rows, cols);
    point_to(this->data(), rows, cols);
  }
  using Map::setZero;
  Recycled& setZero(Eigen::Index rows, Eigen::Index cols = 1) {
    resize(rows, cols);
    Map::setZero();
    return *this;
  }

 private:
  static constexpr Eigen::Index kNoColumns = Plain::ColsAtCompileTime == 1 ? 1 : 0;
  static std::size_t bytes_of(Eigen::Index rows, Eigen::Index cols) {
    return static_cast<std::size_t>(rows * cols) * sizeof(double);
  }
  void point_to(double* data, Eigen::Index rows, Eigen::Index cols) {
    new (static_cast<Map*>(this)) Map(data, rows, cols);  // as Eigen says to
  }
  void swap(Recycled& other) noexcept {
    double* const data = this->data();
    const Eigen::Index rows = this->rows();
    const Eigen::Index cols = this->cols();
    point_to(other.data(), other.rows(), other.cols());
    other.point_to(data, rows, cols);
  }
};

using RecycledMatrix = Recycled<Eigen::MatrixXd>;
using RecycledColumn = Recycled<Eigen::VectorXd>;

}  // namespace tubetrack
