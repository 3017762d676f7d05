#include "tubetrack/sensors/reconnect.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <thread>
#include <tuple>
#include <utility>

#include "stream_clock.hpp"

namespace tubetrack {

namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

class ReconnectingSource final : public FrameSource {
 public:
  ReconnectingSource(std::unique_ptr<FrameSource> device, ReopenDevice reopen, const ReconnectOptions& options)
      : device_(std::move(device)),
        reopen_(std::move(reopen)),
        options_(options),
        info_(device_->info()),
        last_sign_(steady_clock::now()) {}

  const StreamInfo& info() const override { return info_; }
  const std::string& last_problem() const override { return problem_; }
  std::string take_note() override { return device_ ? device_->take_note() : std::string(); }
  std::int64_t dropped() const override { return dropped_before_ + (device_ ? device_->dropped() : 0); }

  FrameOutcome next(DepthFrame& frame, milliseconds patience) override;

 private:
  FrameOutcome lose(std::string why);
  bool reopen_when_due(milliseconds patience);
  FrameOutcome continue_with(FrameOutcome outcome, DepthFrame& frame);

  std::unique_ptr<FrameSource> device_;  ///< empty while it is lost
  ReopenDevice reopen_;
  ReconnectOptions options_;
  StreamInfo info_;
  std::string problem_;
  std::int64_t dropped_before_ = 0;  ///< by the devices that were lost
  std::int64_t first_index_ = 0;     ///< of the device that is open
  std::int64_t next_index_ = 0;
  StreamClock clock_;
  steady_clock::time_point last_sign_;  ///< of life
  steady_clock::time_point next_attempt_;
  milliseconds wait_{0};
};

FrameOutcome ReconnectingSource::next(DepthFrame& frame, milliseconds patience) {
  if (!device_ && !reopen_when_due(patience)) return FrameOutcome::timeout;
  const FrameOutcome outcome = device_->next(frame, patience);
  switch (outcome) {
    case FrameOutcome::ok:
    case FrameOutcome::corrupt:
      return continue_with(outcome, frame);
    case FrameOutcome::device_lost:
      return lose(device_->last_problem());
    case FrameOutcome::timeout:
      if (options_.silence > milliseconds{0} && steady_clock::now() - last_sign_ > options_.silence) {
        return lose(fmt::format("no frame for {:g} s", std::chrono::duration<double>(options_.silence).count()));
      }
      return outcome;
    case FrameOutcome::end_of_stream:
      return outcome;
  }
  return outcome;
}

FrameOutcome ReconnectingSource::lose(std::string why) {
  problem_ = std::move(why);
  dropped_before_ += device_->dropped();
  device_.reset();
  first_index_ = next_index_;
  wait_ = options_.first_wait;
  next_attempt_ = steady_clock::now() + wait_;
  return FrameOutcome::device_lost;
}

bool ReconnectingSource::reopen_when_due(milliseconds patience) {
  const auto until = steady_clock::now() + patience;
  std::this_thread::sleep_until(std::min(until, next_attempt_));
  if (steady_clock::now() < next_attempt_) return false;
  wait_ = std::min(2 * wait_, options_.longest_wait);
  auto opened = reopen_();
  next_attempt_ = steady_clock::now() + wait_;
  if (!opened) {
    problem_ = opened.error().message;
    return false;
  }
  const StreamInfo& now = (*opened)->info();
  const auto camera = [](const StreamInfo& info) {
    const Intrinsics& in = info.intrinsics;
    return std::tuple(in.width, in.height, in.fx_px, in.fy_px, in.cx_px, in.cy_px, in.distortion, info.metres_per_unit);
  };
  if (camera(now) != camera(info_)) {
    problem_ =
        fmt::format("{}: came back as {}x{}, unit {:g} m, fx {:g} px; it was {}x{}, unit {:g} m, fx {:g} px",
                    info_.name, now.intrinsics.width, now.intrinsics.height, now.metres_per_unit, now.intrinsics.fx_px,
                    info_.intrinsics.width, info_.intrinsics.height, info_.metres_per_unit, info_.intrinsics.fx_px);
    return false;
  }
  device_ = std::move(*opened);
  clock_.restart();
  last_sign_ = steady_clock::now();
  return true;
}

FrameOutcome ReconnectingSource::continue_with(FrameOutcome outcome, DepthFrame& frame) {
  last_sign_ = steady_clock::now();
  frame.index += first_index_;
  next_index_ = frame.index + 1;
  if (outcome == FrameOutcome::corrupt) {
    problem_ = device_->last_problem();
    frame.timestamp_s = clock_.shifted(frame.timestamp_s);
    return outcome;
  }
  // The device's own frames rise already, so only the first after a loss can be behind, and restart() is for that.
  frame.timestamp_s = clock_.stamp(frame.timestamp_s, last_sign_).value_or(frame.timestamp_s);
  return outcome;
}

}  // namespace

std::unique_ptr<FrameSource> reconnecting(std::unique_ptr<FrameSource> device, ReopenDevice reopen,
                                          const ReconnectOptions& options) {
  return std::make_unique<ReconnectingSource>(std::move(device), std::move(reopen), options);
}

}  // namespace tubetrack
