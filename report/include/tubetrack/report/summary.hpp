#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// What a run leaves behind, gathered frame by frame.
struct RunSummary {
  struct TubeTotals {
    std::int64_t frames = 0;
    std::int64_t first_frame = 0;
    std::int64_t last_frame = 0;
    std::vector<float> radius_m;
    std::vector<float> length_m;
  };

  std::int64_t frames = 0;
  std::int64_t frames_with_tubes = 0;
  std::int64_t dropped = 0;
  std::map<TrackStatus, std::int64_t> bad;   ///< corrupt, no_pose, deadline
  std::map<std::int64_t, TubeTotals> tubes;  ///< by id
  std::vector<float> latency_ms;             ///< frames that were tracked
  std::vector<StageTimes> stages;
};

bool is_bad(TrackStatus status);
void add_frame(RunSummary& summary, const TubeFrame& frame);
std::int64_t bad_frames(const RunSummary& summary);

/// One page of text, ends with a line end.
std::string summary_text(const RunSummary& summary);

}  // namespace tubetrack
