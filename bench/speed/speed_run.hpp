#pragma once

#include <array>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "race.hpp"
#include "speed_scenes.hpp"
#include "tubetrack/tracker/tracker_config.hpp"
#include "tubetrack/tracker/tube.hpp"

namespace tubetrack::bench {

struct SpeedOptions {
  int frames = 1000;          ///< timed, a row
  int distinct = 60;          ///< rendered, and played forth and back
  int first_frames = 60;      ///< timed of each scene in the table of first frames
  int slow_every = 40;        ///< slow peers get one frame in so many
  double row_seconds = 40.0;  ///< a row ends then, however many frames it has timed; with the slow peers, twice that
};

/// One row: tubetrack on one scene, and what was timed on the same frames.
struct SpeedRow {
  std::string name;
  std::string shows;
  int width = 0;
  int height = 0;
  int true_tubes = 0;
  double mean_tubes = 0.0;       ///< reported a frame
  std::vector<double> frame_ms;  ///< the whole call; processor time, as all but the next two
  std::vector<double> wall_ms;   ///< the same by the tracker's own clock, as its stages
  std::vector<StageTimes> stages;
  std::vector<double> copy_ms;   ///< memcpy of the frame
  std::vector<double> floor_ms;  ///< floor_pass
  std::vector<double> fals_ms;   ///< the peers' yardstick, OpenCV's FALS normals; empty without it
  double tube_pixels = 0.0;      ///< a frame: see `pixels_on_tubes`
  double changed_cells = 0.0;    ///< a frame: see `cells_that_change`
};

/// What another method took on the frames of the moving tube.
struct PeerTimes {
  std::string name;
  std::string does;
  std::vector<double> ms;
  double mean_tubes = std::numeric_limits<double>::quiet_NaN();  ///< found a frame; NaN where it looks for none
};

/// First frames of streams: a fresh tracker for each.
struct FirstFrames {
  std::string name;
  int true_tubes = 0;
  double mean_tubes = 0.0;
  std::vector<double> ms;
  std::vector<double> wall_ms;
  std::vector<StageTimes> stages;
};

/// A scene with one thread and with two, on the wall: a frame of tubetrack, and the floor pass.
struct ThreadsRow {
  std::string name;
  std::array<std::vector<double>, 2> frame_ms;  ///< with one thread, with two
  std::array<std::vector<double>, 2> floor_ms;

  /// How much quicker two threads are, over how much quicker they are at the floor pass.
  double share_of_floor() const;
};
/// All four in turns on the same frames (speed_threads.cpp).
ThreadsRow run_threads(const SpeedScene& speed, const SpeedOptions& options);

struct SpeedReport {
  SpeedOptions options;
  std::vector<SpeedRow> scenes;   ///< still, moving tube, moving camera, three tubes, no tube
  std::vector<SpeedRow> sizes;    ///< the moving tube; 640 × 480 is among the scenes
  std::vector<SpeedRow> counts;   ///< 1, 4 and 16 tubes
  std::vector<SpeedRow> volumes;  ///< the moving tube with 1, 8 and 64 times the volume
  std::vector<SpeedRow> changes;  ///< more and more cells that change
  std::vector<ThreadsRow> threads;
  std::vector<PeerTimes> peers;
  std::vector<FirstFrames> first;
};

/// The peers for a camera; at most one of them is a yardstick.
using Peers = std::function<std::vector<PeerContender>(const Intrinsics&)>;

/// Runs all of it, on one thread but for `threads`; `progress` is told what begins.
SpeedReport run_speed(const SpeedOptions& options, const Peers& peers,
                      const std::function<void(const std::string&)>& progress);

/// The tracker's configuration for such a camera: the defaults, with that camera's noise.
TrackerConfig speed_config(const Intrinsics& camera);

/// Pixels of a frame with a return that see a tube at less than 75°: those that the fit may use. Mean over some frames.
double pixels_on_tubes(const SpeedScene& speed, const std::vector<RenderedFrame>& frames);

/// Cells of the height map that restart, gain or lose their reading in a frame; mean over the frames played forth. With
/// poses given, every cell with a reading.
double cells_that_change(const SpeedScene& speed, const std::vector<RenderedFrame>& frames);

}  // namespace tubetrack::bench
