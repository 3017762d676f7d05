#pragma once

#include "suite.hpp"

namespace tubetrack::bench {

// One random scene of each row (suite.cpp has the table).

SuiteScene straight_scene(Dice& dice);
SuiteScene bent_scene(Dice& dice);
SuiteScene crossing_scene(Dice& dice);
SuiteScene parallel_scene(Dice& dice);
SuiteScene touching_scene(Dice& dice);
SuiteScene pile_scene(Dice& dice);
SuiteScene mixed_radii_scene(Dice& dice);
SuiteScene thin_scene(Dice& dice);
SuiteScene clutter_scene(Dice& dice);
SuiteScene any_tube_scene(Dice& dice);

SuiteScene moving_tube_scene(Dice& dice);
SuiteScene drift_scene(Dice& dice);
SuiteScene leaving_scene(Dice& dice);
SuiteScene hand_scene(Dice& dice);
SuiteScene moving_camera_scene(Dice& dice);
SuiteScene pose_errors_scene(Dice& dice);

}  // namespace tubetrack::bench
