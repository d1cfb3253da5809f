#include "client/commands.h"

int main(int argc, char** argv) {
  return glasswing::run_client(argc, argv, glasswing::add_commands);
}
