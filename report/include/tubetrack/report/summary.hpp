#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "tubetrack/report/quantiles.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack {

/// What only a live run has. Times in milliseconds.
struct LiveFigures {
  Quantiles result_ms;              ///< from the frame's arrival to its result, written
  Quantiles jitter_ms;              ///< |interval on the host's clock − on the device's| between neighbouring frames
  std::int64_t device_dropped = 0;  ///< of `dropped`: by the device; the rest by us, as tracking couldn't keep up
  std::int64_t losses = 0;          ///< how often the device was gone
  double lost_s = 0.0;              ///< and for how long, until its first frame
};

/// What a run leaves behind, gathered frame by frame, in bounded memory.
struct RunSummary {
  struct TubeTotals {
    std::int64_t frames = 0;
    std::int64_t first_frame = 0;
    std::int64_t last_frame = 0;
    Quantiles radius_m{512};
    Quantiles length_m{512};
  };

  std::int64_t frames = 0;
  std::int64_t frames_with_tubes = 0;
  std::int64_t dropped = 0;
  std::int64_t late = 0;  ///< past their deadline: known tubes were followed, new ones were not looked for
  std::map<TrackStatus, std::int64_t> bad;   ///< corrupt, no_pose
  std::map<std::int64_t, TubeTotals> tubes;  ///< by id
  std::int64_t tubes_forgotten = 0;          ///< beyond the 1000 that were seen the longest
  Quantiles latency_ms;                      ///< frames that were tracked
  std::array<Quantiles, 6> stages_ms;        ///< in the order of StageTimes
  LiveFigures live;
};

bool is_bad(TrackStatus status);
void add_frame(RunSummary& summary, const TubeFrame& frame);
std::int64_t bad_frames(const RunSummary& summary);

/// One page of text, ends with a line end; the live figures where there are any.
std::string summary_text(const RunSummary& summary);

}  // namespace tubetrack
