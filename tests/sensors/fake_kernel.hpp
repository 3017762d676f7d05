#pragma once

#include <linux/media.h>
#include <linux/videodev2.h>

#include <atomic>
#include <deque>
#include <initializer_list>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "sensors/fake_camera.hpp"

namespace tubetrack::test {

inline constexpr const char* kFakeVideo = "/dev/video0";
inline constexpr const char* kFakeMedia = "/dev/media0";

/// The kernel's side of the camera. Never destroyed: libcamera's threads may outlive main.
class FakeKernel {
 public:
  static FakeKernel& get() {
    static auto* kernel = new FakeKernel;
    return *kernel;
  }

  void set_up(const FakeCameraSettings& settings) {
    settings_ = settings;
    format_ = settings.formats.front();
    width_ = settings.width;
    height_ = settings.height;
  }
  void unplug() {
    gone_ = true;
    stop_stream();
    tell({{"remove", true}, {"remove", false}});
  }
  void replug() {
    gone_ = false;
    tell({{"add", false}, {"add", true}});
  }

  bool gone() const { return gone_; }
  const std::string& folder() const { return folder_; }
  int monitor() const { return monitor_; }
  bool is_video(int fd) const { return fd >= 0 && fd == video_; }
  bool is_media(int fd) const { return fd >= 0 && fd == media_; }

  /// The descriptor of one of our devices; empty for any other path.
  std::optional<int> open_device(const char* path);
  /// An event for udev: what happened, and whether to the video device (else the media device).
  std::optional<std::pair<std::string, bool>> next_event();
  /// A new monitor hears only what happens from then on.
  void forget_events();

  int video_ioctl(unsigned long request, void* argument);
  int media_ioctl(unsigned long request, void* argument);

 private:
  FakeKernel();
  int row_bytes() const;
  int image_bytes() const { return row_bytes() * height_; }
  void tell(std::initializer_list<std::pair<std::string, bool>> events);
  int set_format(v4l2_pix_format& pix, bool set, bool get);
  int request_buffers(v4l2_requestbuffers& request);
  int dequeue(v4l2_buffer& buffer);
  void stream();
  void stop_stream();
  void fill(v4l2_buffer& buffer, std::uint32_t sequence);
  void send_next(std::uint32_t sequence);

  FakeCameraSettings settings_;
  std::uint32_t format_ = V4L2_PIX_FMT_Y12;
  int width_ = 64;
  int height_ = 48;
  std::string folder_;  ///< what /sys says of the camera's place
  int media_ = -1;
  int video_ = -1;
  int monitor_ = -1;
  std::atomic<bool> gone_ = false;
  std::mutex mutex_;
  std::deque<v4l2_buffer> queued_;
  std::deque<v4l2_buffer> done_;
  std::deque<std::pair<std::string, bool>> events_;
  std::vector<int> buffers_;
  std::atomic<bool> streaming_ = false;
  std::thread thread_;
};

}  // namespace tubetrack::test
