#pragma once

// Private to the libcamera back-end: with the two sources beside it the only place that includes libcamera's headers.
#include <fmt/format.h>
#include <libcamera/libcamera.h>
#include <sys/mman.h>

#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "mono_pixels.hpp"
#include "tubetrack/sensors/libcamera_source.hpp"

namespace tubetrack {

inline tl::unexpected<Error> failed(std::string text) {
  return tl::make_unexpected(Error::failed(std::move(text)));
}

/// One manager a process: a second one aborts inside libcamera.
class LibcameraManager {
 public:
  static Expected<std::unique_ptr<LibcameraManager>> start();
  ~LibcameraManager() { manager_.stop(); }
  LibcameraManager(const LibcameraManager&) = delete;
  LibcameraManager& operator=(const LibcameraManager&) = delete;

  libcamera::CameraManager& operator*() { return manager_; }

 private:
  explicit LibcameraManager(std::unique_lock<std::mutex> turn) : turn_(std::move(turn)) {}
  static std::mutex& one_at_a_time() {
    static std::mutex mutex;
    return mutex;
  }

  std::unique_lock<std::mutex> turn_;
  libcamera::CameraManager manager_;
};

/// A plane of a frame buffer, mapped for reading from the file's beginning: an offset need not be that of a page.
class LibcameraMapping {
 public:
  explicit LibcameraMapping(const libcamera::FrameBuffer::Plane& plane)
      : bytes_(plane.offset + plane.length),
        offset_(plane.offset),
        start_(mmap(nullptr, bytes_, PROT_READ, MAP_SHARED, plane.fd.get(), 0)) {}
  ~LibcameraMapping() {
    if (valid()) munmap(start_, bytes_);
  }
  LibcameraMapping(const LibcameraMapping&) = delete;
  LibcameraMapping& operator=(const LibcameraMapping&) = delete;

  bool valid() const { return start_ != MAP_FAILED; }
  const std::byte* data() const { return static_cast<const std::byte*>(start_) + offset_; }
  std::size_t size() const { return bytes_ - offset_; }

 private:
  std::size_t bytes_;
  std::size_t offset_;
  void* start_;
};

/// The camera of that id, or (empty) the first.
Expected<std::shared_ptr<libcamera::Camera>> choose_libcamera(libcamera::CameraManager& manager, const std::string& id);

std::string libcamera_model(const libcamera::Camera& camera);

/// Sets an acquired camera to the format and size; size and unit of `info` are set.
Expected<std::unique_ptr<libcamera::CameraConfiguration>> configure_libcamera(libcamera::Camera& camera,
                                                                              const LibcameraOptions& options,
                                                                              StreamInfo& info, MonoPacking& packing);

/// Of an image of this size: from the calibration, or the numbers given.
Expected<Intrinsics> libcamera_intrinsics(const LibcameraOptions& options, const StreamInfo& info);

}  // namespace tubetrack
