#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace tubetrack::test {

struct UsbCameraSettings {
  std::vector<std::string> formats = {"Y12 "};  ///< four characters each, as Video4Linux has them
  int width = 640;
  int height = 480;
  int frames_per_second = 10;
};

/// A pixel of frame `number`: the number itself at 0, 0; elsewhere the depth in millimetres (12 bits) of a horizontal
/// tube, radius 40 mm, 0.6 m away before a wall, with noise of ±1 mm that is another in each frame. The camera has
/// f = 0.9 widths and its principal point in the centre.
std::uint16_t usb_camera_pixel(int number, int u, int v, int width, int height);

/// A USB video camera (UVC, bulk transfers) that the kernel sees as plugged in for as long as this lives: it answers
/// the kernel's USB requests over a socket (module vhci-hcd, USB/IP). Takes root. Frames are numbered from 0 as they
/// are sent.
class UsbCamera {
 public:
  explicit UsbCamera(const UsbCameraSettings& settings);
  ~UsbCamera();  ///< pulls the plug
  UsbCamera(const UsbCamera&) = delete;
  UsbCamera& operator=(const UsbCamera&) = delete;

 private:
  using Bytes = std::vector<std::uint8_t>;
  using Header = std::array<std::uint32_t, 12>;  ///< of a USB/IP message, in the host's byte order but for its set-up

  /// What the kernel is waiting for on the endpoint of the pixels.
  struct Request {
    std::uint32_t sequence = 0;
    std::size_t bytes = 0;
  };

  void answer_requests();
  void answer_control(std::uint32_t sequence, const std::array<std::uint8_t, 8>& setup, const Bytes& sent);
  void cancel(std::uint32_t sequence, std::uint32_t cancelled);
  void reply(std::uint32_t sequence, int status, const Bytes& data, std::uint32_t length);
  void send_frames();
  bool send_frame(const Bytes& pixels, bool odd);
  int bits() const;
  Bytes stream_state() const;

  UsbCameraSettings settings_;
  int socket_ = -1;
  std::mutex write_mutex_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Request> requests_;
  bool unplugged_ = false;
  std::uint32_t cancellations_ = 0;  ///< a frame that one falls into is given up
  std::uint8_t format_ = 1;          ///< counted from 1, as the kernel chooses it
  std::thread requests_thread_;
  std::thread frames_thread_;
};

}  // namespace tubetrack::test
