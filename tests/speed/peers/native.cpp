// OMPL's control planners on the same car, problems and collision rule as ours, timed inside.
//
// A server: commands on stdin, one line of answer each on stdout. Lengths in metres, times in seconds.
//   car FRONT REAR WIDTH WHEELBASE MAX_STEERING MIN_SPEED MAX_SPEED MAX_ACCELERATION MAX_STEERING_RATE DT
//   problem BOUNDS*4 START*3 GOAL*2 RADIUS PIECES (CORNERS (X Y)*)*   -> its number
//   free PROBLEM COUNT (STATE*5)*                                     -> 0 or 1 for each state
//   drive STATE*5 COUNT (CONTROL*2)*                                  -> the states after each control
//   plan PLANNER PROBLEM SEED LIMIT LEAST MOST CELL METRIC PARAMETERS (NAME VALUE)*
//        -> {"solved", "seconds", "checks", "controls": [[acceleration, steering rate, steps], ...]}
// Timed, on the processor's clock, is everything from the obstacles to the plan: cell grid, spaces, planner and
// search; not parsing.

#include <ompl/base/goals/GoalSampleableRegion.h>
#include <ompl/base/spaces/RealVectorStateProjections.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/control/PathControl.h>
#include <ompl/control/SpaceInformation.h>
#include <ompl/control/planners/kpiece/KPIECE1.h>
#include <ompl/control/planners/rrt/RRT.h>
#include <ompl/control/spaces/RealVectorControlSpace.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace ob = ompl::base;
namespace oc = ompl::control;

constexpr double CELL_M = 1.0;    // measured: with 2 m as fast, with 0.5 m slower
constexpr double REACH_M = 1.75;  // as planners/world/geometry/collision.py: largest half-diagonal of a box
constexpr double SPARE = 1.0 + 1.0 / 32.0;  // as interface.py: of half a step is covered

struct Car {
    double front, rear, width, wheelbase, max_steering, min_speed, max_speed, max_acceleration, max_steering_rate, dt;
};

struct State {
    double x, y, heading, speed, steering;
};

struct Direction {
    double sin, cos;
};

// Sine and cosine as planners/world/trigonometry.py has them: faster than the C library's.
Direction within_an_eighth(double r) {
    const double z = r * r;
    double s = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
    s = -1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * s));
    double c = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 - z * 1.13596475577881948265e-11);
    c = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * c));
    return {r + r * z * s, 1.0 - 0.5 * z + z * z * c};
}

Direction direction(double angle) {
    const double turns = std::floor(angle * (2.0 / M_PI) + 0.5);
    double r = angle - turns * 1.57079632673412561417e00;
    r -= turns * 6.07710050630396597660e-11;
    r -= turns * 2.02226624879595063154e-21;
    Direction d = within_an_eighth(r);
    const int quarter = int(turns) & 3;
    if (quarter & 1) d = {d.cos, -d.sin};
    if (quarter & 2) d = {-d.sin, -d.cos};
    return d;
}

Direction small_direction(double angle) {
    return std::abs(angle) <= 0.25 * M_PI ? within_an_eighth(angle) : direction(angle);
}

Direction turned_by(const Direction &d, double angle) {
    const Direction t = small_direction(angle);
    return {d.sin * t.cos + d.cos * t.sin, d.cos * t.cos - d.sin * t.sin};
}

double tangent(double angle) {
    const Direction d = small_direction(angle);
    return d.sin / d.cos;
}

// Controls, reduced where a step with them would lead past the limits of speed or steering.
void admissible(const State &s, double &acceleration, double &steering_rate, const Car &car) {
    acceleration =
        std::min(std::max(acceleration, (car.min_speed - s.speed) / car.dt), (car.max_speed - s.speed) / car.dt);
    steering_rate = std::min(std::max(steering_rate, (-car.max_steering - s.steering) / car.dt),
                             (car.max_steering - s.steering) / car.dt);
}

// One classical Runge-Kutta step; speed and steering are linear in time, so all slopes are known beforehand.
State step(const State &s, double acceleration, double steering_rate, const Car &car) {
    const double h = car.dt;
    const double half_speed = s.speed + 0.5 * h * acceleration, end_speed = s.speed + h * acceleration;
    const double half_steering = s.steering + 0.5 * h * steering_rate, end_steering = s.steering + h * steering_rate;
    const double turn_1 = s.speed * tangent(s.steering) / car.wheelbase;
    const double turn_2 = half_speed * tangent(half_steering) / car.wheelbase;
    const double turn_4 = end_speed * tangent(end_steering) / car.wheelbase;
    const Direction d_1 = direction(s.heading), d_2 = turned_by(d_1, 0.5 * h * turn_1);
    const Direction d_3 = turned_by(d_1, 0.5 * h * turn_2), d_4 = turned_by(d_1, h * turn_2);
    return {s.x + h / 6.0 * (s.speed * d_1.cos + 2.0 * half_speed * (d_2.cos + d_3.cos) + end_speed * d_4.cos),
            s.y + h / 6.0 * (s.speed * d_1.sin + 2.0 * half_speed * (d_2.sin + d_3.sin) + end_speed * d_4.sin),
            s.heading + h / 6.0 * (turn_1 + 4.0 * turn_2 + turn_4),
            std::min(std::max(end_speed, car.min_speed), car.max_speed),
            std::min(std::max(end_steering, -car.max_steering), car.max_steering)};
}

struct Margins {
    double along, across;
};

// How far a body point gets along the body and across it in half a step into or out of a state: interface.py's
// half_step_ways.
Margins half_step_ways(const State &s, const Car &car) {
    const double fastest =
        std::min(std::abs(s.speed) + car.max_acceleration * car.dt, std::max(car.max_speed, -car.min_speed));
    const double sharpest = std::min(std::abs(s.steering) + car.max_steering_rate * car.dt, car.max_steering);
    const double turn = fastest * tangent(sharpest) / car.wheelbase;
    const double half = 0.5 * SPARE * car.dt;
    const double ahead = fastest + 0.5 * car.width * turn, across = std::max(car.front, car.rear) * turn;
    const double turned = 0.5 * half * turn;  // the mean angle by which the two mix
    return {half * (ahead + turned * across), half * (across + turned * ahead)};
}

struct Corner {
    double x, y;
};

struct Problem {
    double bounds[4];  // x_min, y_min, x_max, y_max
    State start;
    double goal_x, goal_y, goal_radius;
    std::vector<Corner> corners;  // counter-clockwise within a piece
    std::vector<int> piece_starts;
};

// A problem made ready for collision checks: each cell lists the pieces that a footprint centred in it may meet.
class Scene {
  public:
    explicit Scene(const Problem &problem) : problem_(problem), edges_(problem.corners.size()) {
        const double *bounds = problem.bounds;
        columns_ = int(std::ceil((bounds[2] - bounds[0]) / CELL_M)) + 1;
        const int rows = int(std::ceil((bounds[3] - bounds[1]) / CELL_M)) + 1;
        cell_starts_.assign(rows * columns_ + 1, 0);
        const double half = 0.5 * CELL_M + REACH_M;
        std::vector<std::pair<int, Listed>> listed;
        listed.reserve(64 * problem.piece_starts.size());
        for (int piece = 0; piece + 1 < int(problem.piece_starts.size()); ++piece) {
            const int first = problem.piece_starts[piece], last = problem.piece_starts[piece + 1];
            double x_min = INFINITY, y_min = INFINITY, x_max = -INFINITY, y_max = -INFINITY;
            for (int i = first; i < last; ++i) {
                const Corner &a = problem.corners[i], &b = problem.corners[i + 1 < last ? i + 1 : first];
                const double ex = b.x - a.x, ey = b.y - a.y, length = std::hypot(ex, ey);
                edges_[i] = {ey / length, -ex / length, (ey * a.x - ex * a.y) / length, a.x, a.y};
                x_min = std::min(x_min, a.x), x_max = std::max(x_max, a.x);
                y_min = std::min(y_min, a.y), y_max = std::max(y_max, a.y);
            }
            const int column_0 = std::max(0, int(std::floor((x_min - REACH_M - bounds[0]) / CELL_M)));
            const int column_1 = std::min(columns_ - 1, int(std::floor((x_max + REACH_M - bounds[0]) / CELL_M)));
            const int row_0 = std::max(0, int(std::floor((y_min - REACH_M - bounds[1]) / CELL_M)));
            const int row_1 = std::min(rows - 1, int(std::floor((y_max + REACH_M - bounds[1]) / CELL_M)));
            for (int row = row_0; row <= row_1; ++row)
                for (int column = column_0; column <= column_1; ++column) {
                    const double x = bounds[0] + (column + 0.5) * CELL_M, y = bounds[1] + (row + 0.5) * CELL_M;
                    bool near = true;
                    int facing = first;
                    double widest = -INFINITY;
                    for (int i = first; i < last && near; ++i) {
                        const Edge &edge = edges_[i];
                        const double gap = edge.nx * x + edge.ny * y - edge.offset;
                        near = gap <= half * (std::abs(edge.nx) + std::abs(edge.ny));
                        if (gap > widest) widest = gap, facing = i;
                    }
                    if (near) {
                        listed.push_back({row * columns_ + column, {first, last, facing}});
                        ++cell_starts_[row * columns_ + column + 1];
                    }
                }
        }
        for (size_t cell = 1; cell < cell_starts_.size(); ++cell) cell_starts_[cell] += cell_starts_[cell - 1];
        std::vector<int> next(cell_starts_.begin(), cell_starts_.end() - 1);
        cell_pieces_.resize(listed.size());
        for (const auto &[cell, piece] : listed) cell_pieces_[next[cell]++] = piece;
    }

    // Whether the car's footprint, inflated for the steps into and out of this state, is free.
    bool state_is_free(const State &s, const Car &car) const {
        const auto [along, across] = half_step_ways(s, car);
        const auto [sin, cos] = direction(s.heading);
        const double ahead = 0.5 * (car.front - car.rear);
        return box_is_free(s.x + ahead * cos, s.y + ahead * sin, cos, sin, 0.5 * (car.front + car.rear) + along,
                           0.5 * car.width + across);
    }

  private:
    struct Edge {
        double nx, ny, offset, x, y;  // outward unit normal, normal . corner, the corner that it begins at
    };
    struct Listed {
        int first, last, facing;  // a piece's edges, and that which most often separates: farthest from the cell
    };

    bool box_is_free(double x, double y, double cos, double sin, double half_length, double half_width) const {
        const double extent_x = half_length * std::abs(cos) + half_width * std::abs(sin);
        const double extent_y = half_length * std::abs(sin) + half_width * std::abs(cos);
        const double *bounds = problem_.bounds;
        if (!(x - extent_x >= bounds[0] && x + extent_x <= bounds[2] && y - extent_y >= bounds[1] &&
              y + extent_y <= bounds[3]))
            return false;
        const int cell = int((y - bounds[1]) / CELL_M) * columns_ + int((x - bounds[0]) / CELL_M);
        for (int k = cell_starts_[cell]; k < cell_starts_[cell + 1]; ++k)
            if (box_meets_piece(x, y, cos, sin, half_length, half_width, cell_pieces_[k])) return false;
        return true;
    }

    static bool separates(const Edge &edge, double x, double y, double cos, double sin, double half_length,
                          double half_width) {
        const double extent = half_length * std::abs(edge.nx * cos + edge.ny * sin) +
                              half_width * std::abs(edge.ny * cos - edge.nx * sin);
        return edge.nx * x + edge.ny * y - edge.offset > extent;
    }

    // Separating axes: the piece's edges, then the box's.
    bool box_meets_piece(double x, double y, double cos, double sin, double half_length, double half_width,
                         const Listed &piece) const {
        if (separates(edges_[piece.facing], x, y, cos, sin, half_length, half_width)) return false;
        for (int i = piece.first; i < piece.last; ++i)
            if (separates(edges_[i], x, y, cos, sin, half_length, half_width)) return false;
        double low_u = INFINITY, high_u = -INFINITY, low_w = INFINITY, high_w = -INFINITY;
        for (int i = piece.first; i < piece.last; ++i) {
            const double dx = edges_[i].x - x, dy = edges_[i].y - y;
            const double u = dx * cos + dy * sin, w = dy * cos - dx * sin;
            low_u = std::min(low_u, u), high_u = std::max(high_u, u);
            low_w = std::min(low_w, w), high_w = std::max(high_w, w);
        }
        return !(low_u > half_length || high_u < -half_length || low_w > half_width || high_w < -half_width);
    }

    const Problem &problem_;
    std::vector<Edge> edges_;
    std::vector<int> cell_starts_;
    std::vector<Listed> cell_pieces_;
    int columns_;
};

State &values(ob::State *state) {
    return *reinterpret_cast<State *>(state->as<ob::RealVectorStateSpace::StateType>()->values);
}
const State &values(const ob::State *state) {
    return *reinterpret_cast<const State *>(state->as<ob::RealVectorStateSpace::StateType>()->values);
}

// Distance in position, and METRIC metres for each unit of the other three, heading the short way round.
class CarSpace : public ob::RealVectorStateSpace {
  public:
    CarSpace(const Problem &problem, const Car &car, double metric) : RealVectorStateSpace(5), metric_(metric) {
        ob::RealVectorBounds bounds(5);
        bounds.low = {problem.bounds[0], problem.bounds[1], -M_PI, car.min_speed, -car.max_steering};
        bounds.high = {problem.bounds[2], problem.bounds[3], M_PI, car.max_speed, car.max_steering};
        setBounds(bounds);
    }
    double distance(const ob::State *one, const ob::State *other) const override {
        const State &a = values(one), &b = values(other);
        double squared = (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
        if (metric_ > 0.0) {
            const double turn = std::remainder(a.heading - b.heading, 2.0 * M_PI);
            const double speed = a.speed - b.speed, steering = a.steering - b.steering;
            squared += metric_ * metric_ * (turn * turn + speed * speed + steering * steering);
        }
        return std::sqrt(squared);
    }

  private:
    double metric_;
};

class GoalDisc : public ob::GoalSampleableRegion {
  public:
    GoalDisc(const ob::SpaceInformationPtr &si, const Problem &problem)
        : GoalSampleableRegion(si), problem_(problem), sampler_(si->allocStateSampler()) {
        setThreshold(problem.goal_radius);
    }
    double distanceGoal(const ob::State *state) const override {
        const State &s = values(state);
        return std::hypot(s.x - problem_.goal_x, s.y - problem_.goal_y);
    }
    void sampleGoal(ob::State *state) const override {
        sampler_->sampleUniform(state);
        const double angle = 2.0 * M_PI * rng_.uniform01(), r = problem_.goal_radius * std::sqrt(rng_.uniform01());
        values(state).x = problem_.goal_x + r * std::cos(angle);
        values(state).y = problem_.goal_y + r * std::sin(angle);
    }
    unsigned int maxSampleCount() const override { return std::numeric_limits<unsigned int>::max(); }

  private:
    const Problem &problem_;
    ob::StateSamplerPtr sampler_;
    mutable ompl::RNG rng_;
};

class Drive : public oc::StatePropagator {
  public:
    Drive(const oc::SpaceInformationPtr &si, const Car &car) : StatePropagator(si), car_(car) {}
    void propagate(const ob::State *from, const oc::Control *control, double, ob::State *to) const override {
        const double *given = control->as<oc::RealVectorControlSpace::ControlType>()->values;
        double acceleration = given[0], steering_rate = given[1];
        admissible(values(from), acceleration, steering_rate, car_);
        values(to) = step(values(from), acceleration, steering_rate, car_);
    }
    bool canPropagateBackward() const override { return false; }

  private:
    const Car &car_;
};

class Free : public ob::StateValidityChecker {
  public:
    Free(const ob::SpaceInformationPtr &si, const Scene &scene, const Car &car)
        : StateValidityChecker(si), scene_(scene), car_(car) {}
    bool isValid(const ob::State *state) const override {
        ++checks;
        return scene_.state_is_free(values(state), car_);
    }
    mutable long checks = 0;

  private:
    const Scene &scene_;
    const Car &car_;
};

template <class T>
T read() {
    T value;
    if (!(std::cin >> value)) throw std::runtime_error("A command ended too early or held no number.");
    return value;
}

State read_state() {
    const double x = read<double>(), y = read<double>(), heading = read<double>(), speed = read<double>();
    return {x, y, heading, speed, read<double>()};
}

Problem read_problem() {
    Problem problem;
    for (double &bound : problem.bounds) bound = read<double>();
    problem.start = read_state();
    problem.goal_x = read<double>(), problem.goal_y = read<double>(), problem.goal_radius = read<double>();
    problem.piece_starts = {0};
    for (int pieces = read<int>(); pieces > 0; --pieces) {
        for (int corners = read<int>(); corners > 0; --corners) {
            const double x = read<double>();
            problem.corners.push_back({x, read<double>()});
        }
        problem.piece_starts.push_back(int(problem.corners.size()));
    }
    return problem;
}

// Processor time of this thread: on a quiet machine the same as the wall's.
double cpu_seconds() {
    timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

void plan(const std::vector<Problem> &problems, const Car &car) {
    const auto name = read<std::string>();
    const Problem &problem = problems.at(read<size_t>());
    const auto seed = read<unsigned>();
    const auto limit = read<double>();
    const auto least = read<unsigned>(), most = read<unsigned>();
    const auto cell = read<double>(), metric = read<double>();
    std::map<std::string, std::string> parameters;
    for (int left = read<int>(); left > 0; --left) {
        const auto key = read<std::string>();
        parameters[key] = read<std::string>();
    }
    ompl::RNG::setSeed(seed);

    const double began = cpu_seconds();
    const Scene scene(problem);
    const auto space = std::make_shared<CarSpace>(problem, car, metric);
    space->registerDefaultProjection(std::make_shared<ob::RealVectorOrthogonalProjectionEvaluator>(
        space, std::vector<double>{cell, cell}, std::vector<unsigned>{0, 1}));
    const auto controls = std::make_shared<oc::RealVectorControlSpace>(space, 2);
    ob::RealVectorBounds bounds(2);
    bounds.low = {-car.max_acceleration, -car.max_steering_rate};
    bounds.high = {car.max_acceleration, car.max_steering_rate};
    controls->setBounds(bounds);
    const auto si = std::make_shared<oc::SpaceInformation>(space, controls);
    const auto checker = std::make_shared<Free>(si, scene, car);
    si->setStateValidityChecker(checker);
    si->setStatePropagator(std::make_shared<Drive>(si, car));
    si->setPropagationStepSize(car.dt);
    si->setMinMaxControlDuration(least, most);
    si->setup();
    const auto definition = std::make_shared<ob::ProblemDefinition>(si);
    ob::ScopedState<> start(space);
    values(start.get()) = problem.start;
    values(start.get()).heading = std::remainder(problem.start.heading, 2.0 * M_PI);  // or it is out of bounds
    definition->addStartState(start);
    definition->setGoal(std::make_shared<GoalDisc>(si, problem));
    ob::PlannerPtr planner;
    if (name == "kpiece1")
        planner = std::make_shared<oc::KPIECE1>(si);
    else if (name == "rrt")
        planner = std::make_shared<oc::RRT>(si);
    else
        throw std::runtime_error("Unknown planner " + name + "; known are kpiece1 and rrt.");
    if (!planner->params().setParams(parameters)) throw std::runtime_error("A parameter that " + name + " lacks.");
    planner->setProblemDefinition(definition);
    planner->setup();
    const bool solved = planner->solve(ob::timedPlannerTerminationCondition(limit)) == ob::PlannerStatus::EXACT_SOLUTION;
    const double took = cpu_seconds() - began;

    std::printf("{\"solved\": %s, \"seconds\": %.9f, \"checks\": %ld, \"controls\": [", solved ? "true" : "false",
                took, checker->checks);
    if (solved) {
        const auto &path = static_cast<const oc::PathControl &>(*definition->getSolutionPath());
        for (size_t i = 0; i < path.getControlCount(); ++i) {
            const double *control = path.getControl(i)->as<oc::RealVectorControlSpace::ControlType>()->values;
            std::printf("%s[%.17g, %.17g, %ld]", i ? ", " : "", control[0], control[1],
                        std::lround(path.getControlDuration(i) / car.dt));
        }
    }
    std::printf("]}\n");
}

void answer(const std::string &command, std::vector<Problem> &problems, Car &car) {
    if (command == "car") {
        for (double *field : {&car.front, &car.rear, &car.width, &car.wheelbase, &car.max_steering, &car.min_speed,
                              &car.max_speed, &car.max_acceleration, &car.max_steering_rate, &car.dt})
            *field = read<double>();
        std::printf("ok\n");
    } else if (command == "problem") {
        problems.push_back(read_problem());
        std::printf("%zu\n", problems.size() - 1);
    } else if (command == "free") {
        const Scene scene(problems.at(read<size_t>()));
        for (int left = read<int>(); left > 0; --left) std::putchar(scene.state_is_free(read_state(), car) ? '1' : '0');
        std::putchar('\n');
    } else if (command == "drive") {
        State state = read_state();
        for (int left = read<int>(); left > 0; --left) {
            const double acceleration = read<double>();
            state = step(state, acceleration, read<double>(), car);
            std::printf("%.17g %.17g %.17g %.17g %.17g ", state.x, state.y, state.heading, state.speed, state.steering);
        }
        std::putchar('\n');
    } else if (command == "plan")
        plan(problems, car);
    else
        throw std::runtime_error("Unknown command " + command + ".");
}

int main() {
    ompl::msg::noOutputHandler();
    std::ios::sync_with_stdio(false);
    std::vector<Problem> problems;
    Car car{};
    std::string command;
    try {
        while (std::cin >> command) {
            answer(command, problems, car);
            std::fflush(stdout);
        }
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
