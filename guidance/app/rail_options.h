#pragma once

#include "guidance/app/geometry_command.h"
#include "guidance/app/ground_command.h"
#include "guidance/app/line_command.h"
#include "guidance/app/settle_command.h"
#include "guidance/app/targets_command.h"

namespace CLI {
class App;
}

namespace tbm {

// Each adds one command; its options are filled in by the parser.
CLI::App* AddLine(CLI::App& app, LineRequest& request);
CLI::App* AddTargets(CLI::App& app, TargetsRequest& request);
CLI::App* AddGround(CLI::App& app, GroundRequest& request);
CLI::App* AddSettle(CLI::App& app, SettleRequest& request);
CLI::App* AddGeometry(CLI::App& app, GeometryRequest& request);

}  // namespace tbm
