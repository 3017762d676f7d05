#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>

#include "dice.hpp"
#include "tubetrack/replay/render.hpp"
#include "tubetrack/replay/synthetic_scene.hpp"

namespace tubetrack::bench {

/// One random scene of a row.
struct SuiteScene {
  Scene scene;
  /// Sets what a scene's own motions can't say (a tube that comes back) for one frame; empty where there is none.
  std::function<void(int frame, Scene& scene)> place;
  int single_frame = 0;      ///< the frame of its sequence that is scored alone
  bool pose_errors = false;  ///< the poses the tracker gets are 2 mm and 0.2° off, each frame its own way
};

/// A row of the benchmark: scenes of one kind.
struct Row {
  std::string_view name;
  std::string_view shows;
  SuiteScene (*make)(Dice& dice);
  bool at_rest = true;        ///< camera and tubes
  int frames = 30;            ///< of a sequence; 0: single frames only
  bool holds_tubes = true;    ///< false: whatever is reported is false
  bool single_shots = false;  ///< the row of many random tubes, which has a count of its own
};

/// In the order of the tables.
std::span<const Row> rows();

/// Same row and seed: same scene, which passes `validate`. The noise's seed is the scene's.
SuiteScene make_scene(const Row& row, std::uint64_t seed);

/// What the sensor sees, and what is true. With pose errors the truth keeps the true poses.
RenderedFrame render(const SuiteScene& scene, int frame, const DepthNoise& noise);

}  // namespace tubetrack::bench
