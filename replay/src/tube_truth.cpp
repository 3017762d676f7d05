#include "tubetrack/replay/tube_truth.hpp"
