#pragma once

#include <cstdint>
#include <vector>

namespace tubetrack::test {

/// A UVC camera in a kernel that is not there: fake_camera.cpp stands between libcamera.so and the kernel's media, V4L2
/// and udev interfaces, so that the real libcamera captures from it in this process. It is changed while no stream
/// runs.
struct FakeCameraSettings {
  std::vector<std::uint32_t> formats;  ///< V4L2's codes; the first is the camera's own
  int width = 64;
  int height = 48;
  int stride_bytes = 0;  ///< 0: dense
  int frames_per_second = 100;
  int broken_every = 0;  ///< each so many-th frame carries the kernel's error flag
  int drop_every = 0;    ///< … is never delivered
  int short_every = 0;   ///< … has half of its bytes
  int late_every = 0;    ///< … arrives after the one that follows it
};

void set_up_fake_camera(const FakeCameraSettings& settings);

/// Pulls the cable and puts it in again. Buffers that are queued then are never given back, as with a real one.
void unplug_fake_camera();
void replug_fake_camera();

/// The grey value of the pixel of frame n (counted by its sequence number), of at most `bits`.
std::uint16_t fake_pixel(std::uint32_t sequence, int u, int v, int bits);

}  // namespace tubetrack::test
