#include "tubetrack/replay/recording.hpp"
