// The verbs that edit mattes; they need no server.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

void add_matte_command(CLI::App& app, Client& client);  // with the verbs below

// Each declares its options and sets Client::run.
void add_matte_crop_command(CLI::App& matte, Client& client);
void add_matte_resize_command(CLI::App& matte, Client& client);
void add_matte_flip_command(CLI::App& matte, Client& client);
void add_matte_grade_command(CLI::App& matte, Client& client);
void add_matte_merge_command(CLI::App& matte, Client& client);
void add_matte_join_command(CLI::App& matte, Client& client);
void add_matte_fill_command(CLI::App& matte, Client& client);
void add_matte_deliver_command(CLI::App& matte, Client& client);

}  // namespace glasswing
