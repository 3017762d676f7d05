#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tubetrack/replay/render.hpp"

namespace tubetrack::bench {

/// Something that is done with every frame, and that is timed.
struct Contender {
  std::string name;
  std::function<void(const DepthFrame&)> run;
  std::function<void(const DepthFrame&)> prepare = {};  ///< before it, not timed; may be empty
  int every = 1;                                        ///< is given one frame in so many
};

/// Somebody else's way, in a race.
struct PeerContender {
  Contender contender;
  std::string does;
  bool yardstick = false;  ///< is timed with every row
  bool slow = false;       ///< takes longer than tubetrack should
  /// How many tubes it found, one entry a run; null where it looks for none.
  std::shared_ptr<std::vector<double>> tubes = {};
};

/// Milliseconds of processor time that this thread has had so far. What other programs take is not in it: on a machine
/// that does nothing else it runs as the clock on the wall does.
double thread_ms();
/// Milliseconds on the wall, for what runs on several threads.
double wall_ms();

/// Milliseconds by `clock_ms` of each run, by contender. All of them get frame i before any gets i + 1, so that what
/// else the machine does meets all alike; who is first changes from frame to frame. `count` frames are timed, after
/// `warm_up` that are not; fewer where these would take longer than `most_seconds`.
std::vector<std::vector<double>> race(const std::vector<RenderedFrame>& frames,
                                      const std::vector<Contender>& contenders, int warm_up, int count,
                                      double most_seconds, double (*clock_ms)() = thread_ms);

}  // namespace tubetrack::bench
