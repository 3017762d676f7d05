#pragma once

#include <algorithm>
#include <chrono>
#include <optional>

namespace tubetrack {

/// A device's clock, made one that only goes forward. The host's clock is looked at only where the device's was set
/// anew or stands still: the two run at different rates.
class StreamClock {
 public:
  using HostTime = std::chrono::steady_clock::time_point;

  /// The stream's time (seconds) of a frame that the device stamped `device_s` and that arrived at `received`. Empty
  /// where it is not after the last one: that stamp can't be believed. When the next one is behind as well, and after
  /// the unbelievable one, the clock was set anew, and the stream's time goes on by what passed on the host's. When a
  /// stamp comes for the fifth time running, the clock stands still, and the host's counts from then on.
  std::optional<double> stamp(double device_s, HostTime received) {
    constexpr int kRepeats = 4;
    repeats_ = device_s == last_device_s_ ? repeats_ + 1 : 0;
    last_device_s_ = device_s;
    by_host_ = by_host_ || repeats_ >= kRepeats;
    double stream_s = shifted(device_s);
    if (last_s_ && (stream_s <= *last_s_ || by_host_)) {
      const bool set_anew = by_host_ || restarted_ || (suspect_s_ && device_s > *suspect_s_);
      suspect_s_ = device_s;
      if (!set_anew) return {};
      const double passed_s = std::chrono::duration<double>(received - last_received_).count();
      stream_s = *last_s_ + std::max(passed_s, 1e-6);
      shift_s_ = stream_s - device_s;
    }
    suspect_s_.reset();
    restarted_ = false;
    last_s_ = stream_s;
    last_received_ = received;
    return stream_s;
  }

  /// The device was opened again: its clock may have started anew with it.
  void restart() { restarted_ = true; }

  /// The device's clock stood still, and is not looked at any more.
  bool by_host() const { return by_host_; }

  double shifted(double device_s) const { return device_s + shift_s_; }
  double last_s() const { return last_s_.value_or(0.0); }

 private:
  double shift_s_ = 0.0;
  std::optional<double> last_s_;
  std::optional<double> suspect_s_;
  std::optional<double> last_device_s_;
  int repeats_ = 0;  ///< of last_device_s_
  HostTime last_received_;
  bool restarted_ = false;
  bool by_host_ = false;
};

}  // namespace tubetrack
