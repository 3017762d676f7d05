#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tubetrack/replay/render.hpp"
#include "tubetrack/replay/synthetic_scene.hpp"

namespace tubetrack::bench {

/// A scene to be timed. Its frames are made to be played forth and back.
struct SpeedScene {
  std::string name;
  std::string shows;
  Scene scene;
  /// Sets what moves for the k-th of `count` frames; empty where nothing does.
  std::function<void(int k, int count, Scene& scene)> place;
};

// Lengths in metres, tubes 0.8 m away unless they lie on a table; noise as in docs/scene.md.

/// 640 × 480 unless told otherwise, the same field of view across in any size (1280 × 720 sees less above and below).
Intrinsics speed_camera(int width = 640, int height = 480);
/// The noise of such a camera: of twice the focal length, twice the disparity.
DepthNoise speed_noise(const Intrinsics& camera);

/// One bent tube of radius 20 mm before a wall.
SpeedScene still_scene();
/// The same tube, swinging 0.3 m to the side and by 20° in two seconds.
SpeedScene moving_tube_scene(int width = 640, int height = 480);
/// A tube and a box on a table, the camera swinging by 0.25 m; poses are given.
SpeedScene moving_camera_scene();
/// Three tubes of radius 12.5, 18 and 25 mm, one behind the other, at rest.
SpeedScene three_tubes_scene();
/// A box, a ball and a bowl on a table.
SpeedScene no_tube_scene();
/// Up to 16 tubes of radius 12 mm side by side, all swinging 60 mm to the side.
SpeedScene many_tubes_scene(int tubes);
/// `still_scene` and a board behind the tube that covers `share` of the image, from its lower edge, and jumps by 60 mm
/// from frame to frame: all of its cells change.
SpeedScene changing_scene(double share);

/// Frames `count` of a scene with noise of their own each, rendered on all cores.
std::vector<RenderedFrame> render_all(const SpeedScene& speed, int count);
/// The scene as it is at one of them.
Scene scene_at(const SpeedScene& speed, int k, int count);

/// The i-th frame of a stream that plays the rendered ones forth and back at 30 frames a second; a view of them.
DepthFrame played_frame(const std::vector<RenderedFrame>& frames, int i);

}  // namespace tubetrack::bench
