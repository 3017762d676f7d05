#include "tubetrack/tracker/tube_tracker.hpp"

namespace tubetrack {

struct TubeTracker::State {
  TrackerConfig config;
  Intrinsics intrinsics;
  TubeFrame result;
};

TubeTracker::TubeTracker(std::unique_ptr<State> state) : state_(std::move(state)) {}
TubeTracker::TubeTracker(TubeTracker&&) noexcept = default;
TubeTracker& TubeTracker::operator=(TubeTracker&&) noexcept = default;
TubeTracker::~TubeTracker() = default;

Expected<TubeTracker> TubeTracker::create(const TrackerConfig& config, const Intrinsics& intrinsics) {
  if (auto valid = validate(config); !valid) return tl::make_unexpected(valid.error());
  if (auto valid = validate(intrinsics); !valid) return tl::make_unexpected(valid.error());
  auto state = std::make_unique<State>();
  state->config = config;
  state->intrinsics = intrinsics;
  return TubeTracker(std::move(state));
}

const TubeFrame& TubeTracker::track(const DepthFrame& frame) {
  TubeFrame& result = state_->result;
  result = {};
  result.frame = frame.index;
  result.timestamp_s = frame.timestamp_s;
  result.status = TrackStatus::empty;
  return result;
}

}  // namespace tubetrack
