#pragma once

#include "guidance/rail_study/rail_scene.h"

namespace tbm::test {

using tbm::GeneratedRun;
using tbm::GenerateRail;
using tbm::RailScene;
using tbm::RailTruth;

}  // namespace tbm::test
