"""The literature the package stands on, each work once; code and reports cite it by key.

>>> cite("wu2018")
('Wu, Q.; Wu, R.; Han, F.; Zhang, R. A Three-Stage Accelerometer Self-Calibration Technique for
Space-Stable Inertial Navigation Systems. Sensors 2018, 18, 2888. doi:10.3390/s18092888',)
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

REFERENCES: Mapping[str, str] = MappingProxyType(
    {
        # the papers whose methods are implemented
        "wang2019": "Wang, Z.; Cheng, X.; Fu, J. Optimized Multi-Position Calibration Method with "
        "Nonlinear Scale Factor for Inertial Measurement Units. Sensors 2019, 19, 3568. "
        "doi:10.3390/s19163568",
        "wu2018": "Wu, Q.; Wu, R.; Han, F.; Zhang, R. A Three-Stage Accelerometer Self-Calibration "
        "Technique for Space-Stable Inertial Navigation Systems. Sensors 2018, 18, 2888. "
        "doi:10.3390/s18092888",
        "cai2016": "Cai, Q.; Yang, G.; Song, N.; Liu, Y. Systematic Calibration for Ultra-High Accuracy "
        "Inertial Measurement Units. Sensors 2016, 16, 940. doi:10.3390/s16060940",
        "wei2022": "Wei, Q.; Zha, F.; He, H.; Li, B. An Improved System-Level Calibration Scheme for "
        "Rotational Inertial Navigation Systems. Sensors 2022, 22, 7610. "
        "doi:10.3390/s22197610",
        "xie2011": "Xie, B.; Qin, Y.; Wan, Y. Multiposition Calibration Method of Laser Gyro SINS. Journal of "
        "Chinese Inertial Technology 2011, 19; its 19 positions as in Yan, G. PSINS Toolbox, "
        "demos/test_system_calibration_19pos.m, 2019.",
        "jia2014": "Jia. New Fast Systematic Calibration Method for RLG-SINS. Journal of Chinese Inertial "
        "Technology 2014; its turns as in Yan, G. PSINS Toolbox, demos, 2019.",
        "yan2012": "Yan, G.; Li, S.; Qin, Y. Inertial Instrument Testing and Data Analysis. National Defense "
        "Industry Press, 2012, section 10.4; its turns as in Yan, G. PSINS Toolbox, demos, 2024.",
        "yan2018": "Yan, G.; Yang, X.; Su, X.; Weng, J.; Qin, Y. Error Distribution Method and Analysis of "
        "Observability Degree Based on the Covariances in Kalman Filter. 37th Chinese Control Conference, 2018.",
        "friedland1969": "Friedland, B. Treatment of Bias in Recursive Filtering. IEEE Transactions on "
        "Automatic Control 1969, 14, 359-367. doi:10.1109/TAC.1969.1099223",
        "tedaldi2014": "Tedaldi, D.; Pretto, A.; Menegatti, E. A Robust and Easy to Implement Method for IMU "
        "Calibration without External Equipments. IEEE International Conference on Robotics "
        "and Automation, 2014, 3042-3049. doi:10.1109/ICRA.2014.6907297",
        "wallace_tpoint": "Wallace, P. T. TPOINT Telescope Pointing Analysis System. User manual; and A Rigorous "
        "Algorithm for Telescope Pointing. Proc. SPIE 4848, 2002, 125-136.",
        # standards
        "ieee528": "IEEE Std 528-2019. IEEE Standard for Inertial Sensor Terminology. IEEE, 2019.",
        "ieee836": "IEEE Std 836-2009. IEEE Recommended Practice for Precision Centrifuge Testing of "
        "Linear Accelerometers. IEEE, 2009.",
        "ieee952": "IEEE Std 952-1997. IEEE Standard Specification Format Guide and Test Procedure for "
        "Single-Axis Interferometric Fiber Optic Gyros. IEEE, 1998.",
        "ieee1293": "IEEE Std 1293-2018. IEEE Standard Specification Format Guide and Test Procedure for "
        "Linear Single-Axis, Nongyroscopic Accelerometers. IEEE, 2019.",
        "ieee1431": "IEEE Std 1431-2004. IEEE Standard Specification Format Guide and Test Procedure for "
        "Coriolis Vibratory Gyros. IEEE, 2004.",
        "wgs84": "NIMA TR8350.2. Department of Defense World Geodetic System 1984: Its Definition and "
        "Relationships with Local Geodetic Systems. 3rd ed., National Imagery and Mapping "
        "Agency, 2000.",
        "iers2010": "Petit, G.; Luzum, B. (eds.) IERS Conventions (2010). IERS Technical Note 36. Verlag "
        "des Bundesamts für Kartographie und Geodäsie, 2010.",
        "si2019": "Bureau International des Poids et Mesures. The International System of Units (SI). "
        "9th ed., 2019. (Standard gravity: 3rd CGPM, 1901.)",
        "pdg": "Particle Data Group. Review of Particle Physics, Introduction, section 5.3: "
        "Rounding. Physical Review D 2024, 110, 030001.",
        # books
        "britting1971": "Britting, K. R. Inertial Navigation Systems Analysis. Wiley, 1971.",
        "titterton2004": "Titterton, D. H.; Weston, J. L. Strapdown Inertial Navigation Technology. 2nd ed., "
        "IET and AIAA, 2004.",
        "groves2013": "Groves, P. D. Principles of GNSS, Inertial, and Multisensor Integrated Navigation "
        "Systems. 2nd ed., Artech House, 2013.",
        "lawrence1998": "Lawrence, A. Modern Inertial Technology: Navigation, Guidance, and Control. 2nd ed., "
        "Springer, 1998.",
        "sarkka2013": "Särkkä, S. Bayesian Filtering and Smoothing. Cambridge University Press, 2013.",
        "simon2006": "Simon, D. Optimal State Estimation: Kalman, H-infinity, and Nonlinear Approaches. Wiley, 2006.",
        "bierman1977": "Bierman, G. J. Factorization Methods for Discrete Sequential Estimation. Academic Press, 1977.",
        "westfall1993": "Westfall, P. H.; Young, S. S. Resampling-Based Multiple Testing: Examples and "
        "Methods for p-Value Adjustment. Wiley, 1993.",
        # papers on methods and numerics
        "nash1971": "Nash, R. A.; Levine, S. A.; Roy, K. J. Error Analysis of Space-Stable Inertial "
        "Navigation Systems. IEEE Transactions on Aerospace and Electronic Systems 1971, "
        "AES-7, 617-629.",
        "rauch1965": "Rauch, H. E.; Tung, F.; Striebel, C. T. Maximum Likelihood Estimates of Linear "
        "Dynamic Systems. AIAA Journal 1965, 3, 1445-1450. doi:10.2514/3.3166",
        "vanloan1978": "Van Loan, C. F. Computing Integrals Involving the Matrix Exponential. IEEE "
        "Transactions on Automatic Control 1978, 23, 395-404. doi:10.1109/TAC.1978.1101743",
        "squire1998": "Squire, W.; Trapp, G. Using Complex Variables to Estimate Derivatives of Real "
        "Functions. SIAM Review 1998, 40, 110-112. doi:10.1137/S003614459631241X",
        "savage1998": "Savage, P. G. Strapdown Inertial Navigation Integration Algorithm Design, Parts 1 "
        "and 2. Journal of Guidance, Control, and Dynamics 1998, 21, 19-28 and 208-221. "
        "doi:10.2514/2.4228",
        "kass1995": "Kass, R. E.; Raftery, A. E. Bayes Factors. Journal of the American Statistical "
        "Association 1995, 90, 773-795. doi:10.1080/01621459.1995.10476572",
    }
)


def cite(*keys: str) -> tuple[str, ...]:
    """Return the citations of `keys`, in the order of first mention and each once.

    Raises KeyError with the unknown key and the known ones: a developer writes citations, not a user.
    """
    unknown = [key for key in keys if key not in REFERENCES]
    if unknown:
        raise KeyError(f"no reference is called {unknown[0]!r}; the keys are {', '.join(sorted(REFERENCES))}")
    return tuple(REFERENCES[key] for key in dict.fromkeys(keys))
