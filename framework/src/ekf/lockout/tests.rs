use super::*;

#[test]
fn an_outlier_on_either_side_of_an_outage_causes_no_suspicion_and_a_third_one_does() {
    let suspects = |count: u64| {
        let worst = ("x", 0.0);
        let (since, silence, step) = (Time::MIN, None, false);
        let (contradicted, reported) = (false, false);
        let streak = Streak { since, count, silence, step, contradicted, reported, worst };
        Lockout { streak: Some(streak), ..Lockout::new(None) }.suspects()
    };
    assert_eq!([1, 2, 3].map(suspects), [false, false, true]);
    assert!(!Lockout::new(None).suspects());
}
