#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace tubetrack {

/// Buffers of one size for the pixels of frames. A frame owns its buffer while anybody keeps it; then the buffer comes
/// back, from any thread, so nothing is allocated after warm-up. Frames may outlive whoever made the pool.
class PixelPool : public std::enable_shared_from_this<PixelPool> {
 public:
  explicit PixelPool(std::size_t pixels) : pixels_(pixels) {}

  std::shared_ptr<std::uint16_t> take() {
    std::unique_ptr<std::uint16_t[]> buffer;
    {
      const std::lock_guard lock(mutex_);
      if (!free_.empty()) {
        buffer = std::move(free_.back());
        free_.pop_back();
      }
    }
    if (!buffer) buffer = std::make_unique<std::uint16_t[]>(pixels_);
    return {buffer.release(), [pool = shared_from_this()](std::uint16_t* pixels) { pool->give_back(pixels); }};
  }

 private:
  void give_back(std::uint16_t* pixels) {
    const std::lock_guard lock(mutex_);
    free_.emplace_back(pixels);
  }

  std::size_t pixels_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<std::uint16_t[]>> free_;
};

}  // namespace tubetrack
