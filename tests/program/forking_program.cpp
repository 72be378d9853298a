// SPDX-License-Identifier: Apache-2.0
// The program for tests of many commands: loaded once, and forked for each. Standard input: the folder, the number of
// arguments and the arguments, each ended by a NUL, again and again. Standard output: a line each, the exit code
// (negative: the signal). The arguments name two files for the standard output and error of the last command.
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

int egosgm_main(int argc, char** argv);  // apps/egosgm.cpp

namespace {

int run(const std::string& folder, std::vector<std::string>& arguments, const char* output, const char* errors) {
  const pid_t child = ::fork();
  if (child < 0) return -1;
  if (child == 0) {
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    ::close(STDIN_FILENO);
    ::open("/dev/null", O_RDONLY);
    const bool ready =
        std::freopen(output, "w", stdout) && std::freopen(errors, "w", stderr) && ::chdir(folder.c_str()) == 0;
    ::setenv("PWD", folder.c_str(), 1);
    std::exit(ready ? egosgm_main(static_cast<int>(arguments.size()), argv.data()) : 99);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  for (std::string folder, count; std::getline(std::cin, folder, '\0') && std::getline(std::cin, count, '\0');) {
    std::vector<std::string> arguments{"egosgm"};
    for (int i = std::stoi(count); i > 0; --i) std::getline(std::cin, arguments.emplace_back(), '\0');
    const int code = run(folder, arguments, argv[1], argv[2]);
    std::cout << code << std::endl;
  }
}
