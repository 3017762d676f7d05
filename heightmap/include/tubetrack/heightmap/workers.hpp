#pragma once

#include <atomic>
#include <cstdint>
#include <thread>
#include <vector>

namespace tubetrack {

/// A few threads that do the steps of a frame together, each its share; between steps they wait. Whoever owns them
/// calls `run`, one call at a time.
class Workers {
 public:
  /// Starts `count` − 1 threads: the caller's own is one of them. At least 1.
  explicit Workers(int count);
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;
  ~Workers();

  int count() const { return static_cast<int>(threads_.size()) + 1; }

  /// Calls work(i) once for each i in [0, count()), each on a thread of its own, and returns when all are done. Asks
  /// for no memory. `work` must not throw.
  template <typename Work>
  void run(const Work& work) {
    if (threads_.empty()) return work(0);
    run_on_all(&work, [](const void* it, int i) { (*static_cast<const Work*>(it))(i); });
  }

 private:
  using Call = void (*)(const void* work, int i);
  void run_on_all(const void* work, Call call);
  void serve(int i);

  std::atomic<std::uint32_t> round_ = 0;  ///< goes up by one when there is something to do
  std::atomic<int> busy_ = 0;             ///< threads that are not done with it
  const void* work_ = nullptr;            ///< what there is to do; nothing: to end
  Call call_ = nullptr;
  std::vector<std::jthread> threads_;  ///< last, so that they end before what they use
};

/// The part of [0, size) that is the i-th of `count` about equal ones.
struct Part {
  int begin = 0;
  int end = 0;

  bool operator==(const Part&) const = default;
};
inline Part part_of(int size, int i, int count) {
  return {size * i / count, size * (i + 1) / count};
}

}  // namespace tubetrack
