// The frames of the fake camera, and what a test can do to it.
#include "sensors/fake_camera.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <utility>

#include "sensors/fake_kernel.hpp"

namespace tubetrack::test {

namespace {

int bits_of(std::uint32_t format) {
  if (format == V4L2_PIX_FMT_GREY) return 8;
  if (format == V4L2_PIX_FMT_Y10) return 10;
  return format == V4L2_PIX_FMT_Y12 ? 12 : 16;
}

bool is(int every, std::uint32_t n) {
  return every > 0 && (n + 1) % static_cast<unsigned>(every) == 0;
}

}  // namespace

int FakeKernel::row_bytes() const {
  return settings_.stride_bytes > 0 ? settings_.stride_bytes : width_ * (bits_of(format_) == 8 ? 1 : 2);
}

void FakeKernel::fill(v4l2_buffer& buffer, std::uint32_t sequence) {
  const int bits = bits_of(format_);
  std::vector<std::byte> image(static_cast<std::size_t>(image_bytes()), std::byte{0xee});
  for (int v = 0; v < height_; ++v) {
    std::byte* row = image.data() + v * row_bytes();
    for (int u = 0; u < width_; ++u) {
      const std::uint16_t value = fake_pixel(sequence, u, v, bits);
      std::memcpy(row + u * (bits == 8 ? 1 : 2), &value, bits == 8 ? 1 : 2);
    }
  }
  const int fd = buffer.memory == V4L2_MEMORY_DMABUF ? buffer.m.fd : buffers_.at(buffer.index);
  if (pwrite(fd, image.data(), image.size(), 0) < 0) std::perror("fake frame");
  buffer.bytesused = buffer.length = static_cast<unsigned>(image.size());
  buffer.sequence = sequence;
  buffer.field = V4L2_FIELD_NONE;
  buffer.flags = V4L2_BUF_FLAG_DONE | V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  buffer.timestamp.tv_sec = now.tv_sec;
  buffer.timestamp.tv_usec = now.tv_nsec / 1000;
}

/// With mutex_ held, and a buffer queued.
void FakeKernel::send_next(std::uint32_t sequence) {
  v4l2_buffer buffer = queued_.front();
  queued_.pop_front();
  fill(buffer, sequence);
  if (is(settings_.broken_every, sequence)) buffer.flags |= V4L2_BUF_FLAG_ERROR;
  if (is(settings_.short_every, sequence)) buffer.bytesused /= 2;
  done_.push_back(buffer);
  const std::uint64_t one = 1;
  if (write(video_, &one, sizeof one) < 0) std::perror("fake frame");
}

void FakeKernel::stream() {
  std::optional<std::uint32_t> late;
  auto next = std::chrono::steady_clock::now();
  for (std::uint32_t sequence = 0; streaming_; ++sequence) {
    next += std::chrono::microseconds(1000000 / settings_.frames_per_second);
    std::this_thread::sleep_until(next);
    const std::lock_guard lock(mutex_);
    if (queued_.empty() || is(settings_.drop_every, sequence)) continue;
    if (is(settings_.late_every, sequence)) {
      late = sequence;
      continue;
    }
    send_next(sequence);
    if (late && !queued_.empty()) send_next(*std::exchange(late, std::nullopt));
  }
}

void FakeKernel::stop_stream() {
  streaming_ = false;
  if (thread_.joinable()) thread_.join();
  const std::lock_guard lock(mutex_);
  queued_.clear();
  done_.clear();
  for (std::uint64_t count = 0; video_ >= 0 && read(video_, &count, sizeof count) > 0;) {
  }
}

void set_up_fake_camera(const FakeCameraSettings& settings) {
  FakeKernel::get().set_up(settings);
}
void unplug_fake_camera() {
  FakeKernel::get().unplug();
}
void replug_fake_camera() {
  FakeKernel::get().replug();
}

std::uint16_t fake_pixel(std::uint32_t sequence, int u, int v, int bits) {
  return static_cast<std::uint16_t>((static_cast<unsigned>(u * 31 + v * 57) + sequence * 7) * 2654435761U >>
                                    (32 - bits));
}

}  // namespace tubetrack::test
