// The law of pf_law.h as a class.
#pragma once

#include <stdexcept>

#include "pf_law.h"

namespace pf {

class Law {
public:
    explicit Law(const pf_law_said &said)
    {
        if (pf_law_init(&law_, &said) != 0) {
            throw std::runtime_error("pf_law_init failed");
        }
    }

    // Return the torques [N m], PF_LAW_JOINTS of them; setpoint is nullptr if there is no new one.
    const double *step(const pf_law_said &said, const pf_law_setpoint *setpoint = nullptr) noexcept
    {
        pf_law_step(&law_, &said, setpoint);
        return law_.torque;
    }

    void reset_at(const pf_law_said &said, double level) noexcept { pf_law_reset_at(&law_, &said, level); }
    void stop() noexcept { pf_law_stop(&law_); }
    void resume() noexcept { pf_law_resume(&law_); }
    bool stopped() const noexcept { return pf_law_stopped(&law_) != 0; }
    const pf_law &state() const noexcept { return law_; }
    pf_law &state() noexcept { return law_; }

private:
    pf_law law_;
};

}  // namespace pf
